"""The settings of full-scene replay."""

from dataclasses import dataclass
from typing import Literal

from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.sumo.vehicle_types import DEFAULT_DRIVERS, ReleasedDrivers


@dataclass(frozen=True)
class FullScene:
    """How the other logged cars take part, and from when on the method drives the host.

    Attributes:
        others: `log`: all keep to their logs, and may drive through the host; `released`: those that come near the host
            are handed to SUMO's models. The merging car keeps to its log.
        take_over: Time after the encounter's start from which the method drives [s]; it observes from the start on.
        heed_leader: The host keeps distance to the car ahead in its lane as well.
        ahead, behind: Which cars are near [m]; see `LoggedTraffic.release_near`.
        drivers: How released cars drive.
    """

    others: Literal["log", "released"] = "log"
    take_over: NonNegativeFloat = 0.0
    heed_leader: bool = True
    ahead: PositiveFloat = 30.0
    behind: PositiveFloat = 60.0
    drivers: ReleasedDrivers = DEFAULT_DRIVERS

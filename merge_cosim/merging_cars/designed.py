"""The papers' designed merging strategy: accelerate to the limit, or keep distance to a host ahead."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat

from merge_cosim.controllers.law import DistanceKeeping
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.merging_cars.ahead import Ahead, host_ahead
from merge_cosim.merging_cars.base import MergingCar, merging_cars


@merging_cars.register
@dataclass(kw_only=True)
class Designed(DistanceKeeping, MergingCar):
    """No car ahead: free driving to the limit. Host ahead: distance keeping to it (Dong et al. 2017, Sec. V-B).

    The papers do not say when the host is 'ahead'; `ahead` sets it.

    Attributes:
        headway: Time headway T [s].
        ahead: `clear`: the host's rear bumper is past the merging car's front bumper; `in-lane`: the host's front is
            past the merging car's, both past the merging point; `any`: the host's front is past the merging car's.
    """

    name: ClassVar[str] = "designed"
    memory = ()
    headway: NonNegativeFloat = 1.0
    ahead: Ahead = "clear"

    def next_speed(self, age: IntArray, now: Observation) -> FloatArray:
        """One step of the strategy."""
        limit = self.setting.speed_limit
        acceleration = self.drive(*host_ahead(now, self.ahead), now.merging_speed, now.host_speed, limit)
        return np.maximum(now.merging_speed + acceleration * self.setting.dt, 0.0)

"""The sensor without an error."""

from dataclasses import dataclass
from typing import ClassVar

from merge_cosim.core.observation import Observation
from merge_cosim.sensors.base import Sensor, sensors


@sensors.register
@dataclass(kw_only=True)
class Perfect(Sensor):
    """The host observes the merging car as it is."""

    name: ClassVar[str] = "perfect"
    memory = ()

    def observe(self, now: Observation) -> Observation:
        """The true state, without a copy."""
        return now

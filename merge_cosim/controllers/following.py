"""Controllers that keep distance to the merging car when it is the target, and else drive freely."""

from dataclasses import dataclass

from merge_cosim.controllers.base import Controller
from merge_cosim.controllers.law import FollowingLaw
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import BoolArray, FloatArray


@dataclass(kw_only=True)
class Following(FollowingLaw, Controller):
    """A controller made of a law of following."""

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """Distance keeping to the target, free driving without one."""
        gap = seen.merging_station - seen.merging_length - seen.host_station
        return self.drive(target, gap, seen.host_speed, seen.merging_speed, self.setting.speed_limit)

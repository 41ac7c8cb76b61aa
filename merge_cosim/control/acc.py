"""Adaptive cruise control: keep distance to the merging car when it is the target, else drive freely."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from merge_cosim.control.base import Controller, controllers
from merge_cosim.control.law import DistanceKeeping
from merge_cosim.observation import Observation
from merge_cosim.units import BoolArray, FloatArray


@controllers.register
@dataclass(kw_only=True)
class Acc(DistanceKeeping, Controller):
    """The papers' off-the-shelf distance keeping (Dong, Dolan, Litkouhi 2017); see `DistanceKeeping`."""

    name: ClassVar[str] = "acc"

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """Distance keeping to the target, free driving without one."""
        gap = seen.merging_station - seen.merging_length - seen.host_station
        free = self.free(seen.host_speed, self.setting.speed_limit)
        keep = self.follow(gap, seen.host_speed, seen.merging_speed)
        return self.clip(np.where(target, np.minimum(keep, free), free))

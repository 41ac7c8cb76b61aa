"""The merging car as SUMO drives it: nothing is commanded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.merging_cars.base import MergingCar, merging_cars


@merging_cars.register
@dataclass(kw_only=True)
class BySumo(MergingCar):
    """Driven by SUMO's own models, in living traffic: it makes or takes its gap and reacts to the host."""

    name: ClassVar[str] = "sumo"

    def next_speed(self, age: IntArray, now: Observation) -> FloatArray:
        """Zero: SUMO decides."""
        return np.zeros_like(now.merging_speed)

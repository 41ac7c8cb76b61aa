"""A driver that accelerates late and hard, without a look at the host."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat

from merge_cosim.controllers.law import DistanceKeeping
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys, uniform
from merge_cosim.core.units import TOLERANCE, Acceleration, FloatArray, IntArray
from merge_cosim.merging_cars.ahead import host_ahead
from merge_cosim.merging_cars.base import MergingCar, merging_cars


@merging_cars.register
@dataclass(kw_only=True)
class LateAccelerating(DistanceKeeping, MergingCar):
    """Holds its speed, and from a point shortly before the merging point accelerates as hard as it can to the limit.

    Past the merging point it keeps distance to a host ahead and drives freely without one. The driver has no intention:
    the order follows from the two arrivals.

    Attributes:
        seed: Seed of the points.
        nearest, farthest: The way to the merging point at which it begins is uniform between these [m].
        headway: Time headway to a host ahead [s].
        max_acceleration: Its acceleration [m/s^2].
    """

    name: ClassVar[str] = "late-accelerating"
    seed: int = 0
    nearest: NonNegativeFloat = 20.0
    farthest: NonNegativeFloat = 50.0
    headway: NonNegativeFloat = 0.8
    max_acceleration: Acceleration = 3.0

    def __post_init__(self) -> None:
        """Check what must fit together."""
        if self.nearest > self.farthest:
            raise ValueError("nearest is above farthest")

    def ways(self, encounters: Encounters) -> FloatArray:
        """Ways to the merging point at which the drivers begin to accelerate [m], shape (n,)."""
        keys = stream_keys(np.array([f"late/{case}" for case in encounters.case]), self.seed)
        drawn = uniform(keys, np.zeros(len(encounters), dtype=np.int64), 1)[:, 0]
        return self.nearest + (self.farthest - self.nearest) * drawn

    def start(self, encounters: Encounters, count: int, setting: Setting) -> None:
        """Draw the points."""
        super().start(encounters, count, setting)
        self._of_cases, self._way = self.ways(encounters), np.zeros(count)

    def reset(self, rows: IntArray, cases: IntArray) -> None:
        """Set the points of the rows."""
        self._way[rows] = self._of_cases[cases]

    def next_speed(self, age: IntArray, now: Observation) -> FloatArray:
        """One step: the same speed, full acceleration, or distance keeping."""
        limit = self.setting.speed_limit
        merged = self.drive(*host_ahead(now, "any"), now.merging_speed, now.host_speed, limit)
        before = np.where(now.merging_station >= -self._way - TOLERANCE, self.max_acceleration, 0.0)
        acceleration = np.where(now.merging_in_lane, merged, before)
        return np.clip(now.merging_speed + acceleration * self.setting.dt, 0.0, limit)

"""Replay: the merging car drives as it was logged and never reacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.merging_cars.base import MergingCar, merging_cars


@merging_cars.register
@dataclass(kw_only=True)
class Replay(MergingCar):
    """Is at the logged station in every cycle: `v_t = (s_t - s_{t-1}) / dt`.

    After the end of the log the car keeps its last speed. The host observes the causally filtered (or raw) speed of the
    log, not the smoothed one that the car drives with, which depends on later samples.
    """

    name: ClassVar[str] = "replay"
    memory = ("_row_first", "_row_last")

    def start(self, encounters: Encounters, count: int, setting: Setting) -> None:
        """Take the logs.

        Raises:
            UserError: The encounters have no logs.
        """
        super().start(encounters, count, setting)
        if encounters.log is None:
            raise UserError(
                "merging car 'replay' needs logged encounters (kind = \"pairs\"); use 'designed' for a grid"
            )
        track = encounters.log.merging_station
        self._station = track.values
        self._seen = encounters.log.merging_speed.values
        self._first = track.offsets[:-1]
        self._last = track.offsets[1:] - 1
        self._row_first = np.zeros(count, dtype=np.int64)
        self._row_last = np.ones(count, dtype=np.int64)

    def reset(self, rows: IntArray, cases: IntArray) -> None:
        """Set the logs of the rows."""
        self._row_first[rows] = self._first[cases]
        self._row_last[rows] = self._last[cases]

    def next_speed(self, age: IntArray, now: Observation) -> FloatArray:
        """The speed to the log's next station."""
        return self.speed(age)

    def speed(self, age: IntArray) -> FloatArray:
        """The logged speed [m/s] from cycle `age` to the next, shape (n,); past the log's end the last one."""
        following = np.minimum(self._row_first + age + 1, self._row_last)
        step = (self._station[following] - self._station[following - 1]) / self.setting.dt
        return np.maximum(step, 0.0)

    def observed_speed(self, age: IntArray, speed: FloatArray) -> FloatArray:
        """The log's observable speed; past its end the true one."""
        now = self._row_first + age
        return np.where(now <= self._row_last, self._seen[np.minimum(now, self._row_last)], speed)

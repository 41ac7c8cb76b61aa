"""How far a host is from the human who was logged in its place."""

from __future__ import annotations

import numpy as np

from merge_cosim.encounter import ReplayLog
from merge_cosim.observation import Observation
from merge_cosim.units import DT, FloatArray, IntArray

LIKENESS = {"station_square_sum": 0.0, "speed_square_sum": 0.0}
"""What is kept [m^2, m^2/s^2], and its value at the start."""


class Likeness:
    """Squared differences to the logged host, summed cycle by cycle while his log lasts; zero without a log."""

    def __init__(self, block: FloatArray, log: ReplayLog | None) -> None:
        """Take the place for `LIKENESS`, shape (2, count), filled with zeros."""
        count = block.shape[1]
        self._sums = block
        self._log = None if log is None else log.host_station
        if self._log is not None:
            speed = np.diff(self._log.values, prepend=0.0) / DT  # the first of each log is never read
            self._logs = self._log.values, speed
            self._first = np.zeros(count, dtype=np.int64)
            self._last = np.zeros(count, dtype=np.int64)

    def reset(self, rows: IntArray, cases: IntArray) -> None:
        """Begin the encounters `cases` of the log at `rows`; the block has been reset."""
        if self._log is not None:
            self._first[rows] = self._log.offsets[cases]
            self._last[rows] = self._log.offsets[cases + 1] - 1

    def moved(self, age: IntArray, now: Observation) -> None:
        """Take in cycle `age` of each encounter."""
        if self._log is None:
            return
        at = self._first + age
        joint = at <= self._last
        at = np.minimum(at, self._last)
        for total, log, own in zip(self._sums, self._logs, (now.host_station, now.host_speed), strict=True):
            apart = (own - log.take(at)) * joint
            total += apart * apart

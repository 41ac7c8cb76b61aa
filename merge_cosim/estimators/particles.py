"""Clouds of particles over a batch of encounters: what they hold, how they are drawn and resampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from merge_cosim.core.random_streams import Keys, normal, uniform
from merge_cosim.core.units import FloatArray, IntArray


@dataclass(frozen=True)
class Cloud:
    """Guesses about n merging cars, M for each; every array has shape (n, M).

    Attributes:
        station, speed: State of the merging car [m, m/s].
        maneuver: Index of what its driver does.
    """

    station: FloatArray
    speed: FloatArray
    maneuver: IntArray

    @classmethod
    def empty(cls, count: int, size: int) -> Cloud:
        """Room for `count` encounters with `size` particles each."""
        return cls(np.zeros((count, size)), np.zeros((count, size)), np.zeros((count, size), dtype=np.int64))

    def take(self, rows: IntArray) -> Cloud:
        """The clouds at `rows`."""
        return Cloud(self.station[rows], self.speed[rows], self.maneuver[rows])

    def put(self, rows: IntArray, other: Cloud) -> None:
        """Replace the clouds at `rows` by those of `other`."""
        self.station[rows], self.speed[rows], self.maneuver[rows] = other.station, other.speed, other.maneuver


class Dice:
    """The random streams of a batch of encounters, each with its own counter of numbers drawn."""

    def __init__(self, count: int) -> None:
        self._keys: Keys = np.zeros(count, dtype=np.uint64)
        self._drawn = np.zeros(count, dtype=np.int64)

    def reset(self, rows: IntArray, keys: Keys) -> None:
        """Begin new streams at `rows`."""
        self._keys[rows], self._drawn[rows] = keys, 0

    def uniform(self, rows: IntArray, count: int) -> FloatArray:
        """The next `count` numbers on (0, 1) of the streams at `rows`, shape (m, count)."""
        return uniform(self._keys[rows], self._advance(rows, count), count)

    def normal(self, rows: IntArray, count: int) -> FloatArray:
        """The next `count` standard normal numbers of the streams at `rows`, shape (m, count)."""
        return normal(self._keys[rows], self._advance(rows, count), count)

    def streams(self, rows: IntArray) -> tuple[Keys, IntArray]:
        """Keys of the streams at `rows` and how many numbers of each were drawn, shape (m,) each."""
        return self._keys[rows], self._drawn[rows]

    def went_on(self, rows: IntArray, drawn: IntArray) -> None:
        """So many numbers of the streams at `rows` have been drawn now."""
        self._drawn[rows] = drawn

    def _advance(self, rows: IntArray, count: int) -> IntArray:
        first = self._drawn[rows]
        self._drawn[rows] = first + count
        return first


def low_variance(weights: FloatArray, start: FloatArray, count: int) -> IntArray:
    """Low-variance resampling (Thrun, Burgard, Fox, Probabilistic Robotics, Table 4.4) without a search.

    The j-th draw is the particle whose share of the cumulative weight holds `(start + j) / count`. So
    `ceil(count c_i - start)` draws fall to the particles up to i, and the particle of draw j is the number of
    particles of which that count is at most j.

    Args:
        weights: Weights, not all 0 in any row, shape (n, M).
        start: Where the comb begins, in (0, 1), shape (n,).
        count: Number K of draws per row.

    Returns:
        Indices of the particles drawn, ascending, shape (n, K).
    """
    n = len(weights)
    cumulative = np.cumsum(weights, axis=1)
    cumulative *= count / cumulative[:, -1:]
    cumulative -= start[:, None]
    drawn = np.clip(np.ceil(cumulative), 0, count).astype(np.int64)
    drawn[:, -1] = count
    drawn += np.arange(n)[:, None] * (count + 1)
    ends = np.bincount(drawn.ravel(), minlength=n * (count + 1)).reshape(n, count + 1)
    return np.cumsum(ends[:, :count], axis=1)

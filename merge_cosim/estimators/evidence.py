"""Evidence from a driver's speeds: the log ratio of each transition, and its running sum over a window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from merge_cosim.core.units import FloatArray, IntArray

LogRatio = Callable[[FloatArray, FloatArray], FloatArray]
"""From the speeds before and now [m/s] to `log P(now | before, N) - log P(now | before, Y)`, all of shape (n,)."""


class SpeedDensity(Protocol):
    """P(V_t | V_{t-lag}, I) in any form."""

    def log_ratio(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """`log P(now | before, N) - log P(now | before, Y)`, shape (n,)."""

    def log_density(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """`log P(now | before, I)` per m/s, shape (2, n)."""


class SpeedEvidence:
    """`S_t = q S_{t-1} + r_t - q^w r_{t-w}`, so `S_t = sum_{i<w} q^i r_{t-i}`, in O(1) per cycle.

    `r_t` is the log ratio of the speeds `lag` cycles apart, divided by `lag` because such transitions overlap; it is 0
    until a driver has been seen for `lag` cycles, and so is every term before that.

    Args:
        log_ratio: Log ratio of a transition.
        lag: Cycles between its two speeds.
        window: Number w of terms.
        keep: Share q of a term's weight that is left after one cycle; 1 forgets nothing within the window.
    """

    def __init__(self, log_ratio: LogRatio, lag: int, window: int, keep: float = 1.0) -> None:
        self._log_ratio = log_ratio
        self._lag, self._window = lag, window
        self._keep, self._left = keep, keep**window

    def start(self, count: int) -> None:
        """Make room for `count` drivers. All share one ring buffer; a driver that begins later has zeros in it."""
        self._cycle, self._settled = 0, self._lag
        self._begin = np.zeros(count, dtype=np.int64)
        self._sum = np.zeros(count)
        self._terms = np.zeros((self._window, count))
        self._speeds = np.zeros((self._lag, count))

    def reset(self, rows: IntArray) -> None:
        """Forget the drivers at `rows`."""
        self._begin[rows] = self._cycle
        self._settled = self._cycle + self._lag
        self._sum[rows] = 0.0
        self._terms[:, rows] = 0.0

    def thin(self, rows: IntArray) -> None:
        """Go on with the drivers at `rows` alone, in that order."""
        self._begin, self._sum = self._begin[rows], self._sum[rows]
        self._terms, self._speeds = (held.take(rows, axis=-1) for held in (self._terms, self._speeds))

    def add(self, speed: FloatArray) -> FloatArray:
        """Take in the speeds of one cycle [m/s] and return S_t; both of shape (n,)."""
        before = self._speeds[self._cycle % self._lag]
        ratio = self._log_ratio(before, speed)
        if self._cycle < self._settled:  # some drivers have no speed `lag` cycles ago
            ratio *= self._begin <= self._cycle - self._lag
        if self._lag > 1:
            ratio /= self._lag
        before[:] = speed
        oldest = self._terms[self._cycle % self._window]
        self._sum = self._keep * self._sum + (ratio - self._left * oldest)
        oldest[:] = ratio
        self._cycle += 1
        return self._sum

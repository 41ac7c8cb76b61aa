"""Counts of speed transitions and of times to arrival, and the tables of probabilities made from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from merge_cosim.core.encounter import Intention
from merge_cosim.core.units import BoolArray, FloatArray, IntArray

SPEED_BIN = 1.0
"""Width of a speed bin [m/s] (Dong, Dolan, Litkouhi 2017, Sec. IV-A)."""
SPEED_BINS = 40
TIME_BIN = 0.5
"""Width of a bin of time to arrival [s]."""
TIME_BINS = 30
"""Bins of time to arrival; the last one is open, in training and in look-up: it holds all times from 14.5 s on."""
SUPPORT = 2
"""A cell of times to arrival that is further than this [bins] from every filled one says nothing."""
KERNEL = np.exp(-0.5 * np.arange(-4, 5) ** 2) / np.exp(-0.5 * np.arange(-4, 5) ** 2).sum()
"""A Gaussian with a standard deviation of one bin, up to four bins away (importing SciPy's filters takes 0.3 s)."""


def speed_bin(speed: FloatArray) -> IntArray:
    """Index of each speed's bin, clipped to the table."""
    return np.minimum(np.maximum(speed / SPEED_BIN, 0.0), SPEED_BINS - 1).astype(np.int64)


def time_bin(time: FloatArray) -> IntArray:
    """Index of each time to arrival's bin; the last bin is open."""
    return np.minimum(time / TIME_BIN, TIME_BINS - 1).astype(np.int64)


@dataclass(frozen=True)
class SpeedTable:
    """P(V_t | V_{t-lag}, I) as a table over speed bins.

    Attributes:
        probabilities: Shape (2, SPEED_BINS, SPEED_BINS) as [I, from, to].
    """

    probabilities: FloatArray

    @cached_property
    def log_odds(self) -> FloatArray:
        """`log P(V_t | V_{t-lag}, N) - log P(V_t | V_{t-lag}, Y)`, shape (SPEED_BINS, SPEED_BINS); 0 where unknown."""
        return log_ratio(self.probabilities)

    def log_ratio(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """Evidence for NOT_YIELD in the transition of each car, shape (n,)."""
        return self.log_odds[speed_bin(before), speed_bin(now)]

    def log_density(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """`log P(now | before, I)` per m/s, shape (2, n); -inf where the table holds 0."""
        with np.errstate(divide="ignore"):
            return np.log(self.probabilities[:, speed_bin(before), speed_bin(now)] / SPEED_BIN)


@dataclass(frozen=True)
class SpeedHistogram:
    """Counts of speed transitions; index 0 is YIELD, index 1 NOT_YIELD.

    Attributes:
        counts: Shape (2, SPEED_BINS, SPEED_BINS) as [I, from, to].
    """

    counts: IntArray

    @classmethod
    def fit(cls, before: FloatArray, now: FloatArray, label: IntArray) -> SpeedHistogram:
        """Count transitions; all arguments have shape (n,)."""
        counts = np.zeros((2, SPEED_BINS, SPEED_BINS), dtype=np.int64)
        np.add.at(counts, (label, speed_bin(before), speed_bin(now)), 1)
        return cls(counts)

    def with_background(self, epsilon: float) -> SpeedTable:
        """Mix each row with a background that both intentions share, so that an unseen transition says little.

        `P(j|i, I) = (1 - eps) n_I(ij) / n_I(i) + eps Q(j|i)`; Q pools both intentions under a kernel of one bin and
        is all there is where either intention has never been seen in a row. (With additive counts every unseen
        transition would speak for the rarer intention.)
        """
        background = _normalised_rows(blurred(self.counts.sum(axis=0).astype(np.float64)))
        seen = (self.counts.sum(axis=2) > 0).all(axis=0)[None, :, None]
        return SpeedTable(np.where(seen, (1.0 - epsilon) * self._shares() + epsilon * background, background))

    def with_neighbours(self) -> SpeedTable:
        """Give each empty cell the mean of the up to eight cells around it (Lyu, Dong, Dolan 2020, Sec. IV-B).

        The rows no longer sum to one, which a factor of a factor graph need not. A cell that is still empty for one
        intention says nothing.
        """
        shares = self._shares()
        padded = np.pad(shares, ((0, 0), (1, 1), (1, 1)))
        inside = np.pad(np.ones_like(shares), ((0, 0), (1, 1), (1, 1)))
        means = _around(padded) / _around(inside)
        return SpeedTable(np.where(self.counts > 0, shares, means))

    def _shares(self) -> FloatArray:
        return np.stack([_normalised_rows(counts) for counts in self.counts.astype(np.float64)])


@dataclass(frozen=True)
class ArrivalHistogram:
    """Shares of each pair's frames by time to arrival, summed over pairs; index 0 is YIELD, index 1 NOT_YIELD.

    Attributes:
        shares: Shape (2, TIME_BINS, TIME_BINS) as [I, T_m, T_h].
    """

    shares: FloatArray

    def probabilities(self, uniform: float) -> FloatArray:
        """Return P(T_m, T_h | I), shape (2, TIME_BINS, TIME_BINS), smoothed by one bin and mixed with uniform."""
        smooth = np.stack([blurred(one) for one in self.shares])
        shares = smooth / smooth.sum(axis=(1, 2), keepdims=True)
        return (1.0 - uniform) * shares + uniform / shares[0].size

    def log_odds(self, uniform: float) -> FloatArray:
        """Return `log P(T_m, T_h | N) - log P(T_m, T_h | Y)`, shape (TIME_BINS, TIME_BINS); 0 outside the support."""
        return np.where(self.support, log_ratio(self.probabilities(uniform)), 0.0)

    @cached_property
    def support(self) -> BoolArray:
        """The cells that have a filled one at most `SUPPORT` bins away, shape (TIME_BINS, TIME_BINS)."""
        filled = np.pad((self.shares > 0).any(axis=0), SUPPORT)
        near: BoolArray = np.logical_or.reduce(sliding_window_view(filled, (2 * SUPPORT + 1,) * 2), axis=(2, 3))
        return near

    def supports(self, merging_arrival: FloatArray, host_arrival: FloatArray) -> BoolArray:
        """Whether two times to arrival [s] lie in the support, shape (n,)."""
        return self.support[time_bin(merging_arrival), time_bin(host_arrival)]

    def symmetric(self) -> ArrivalHistogram:
        """Count every pair once more with the roles swapped: the host yields where the merging car does not.

        Merging is topologically symmetric (Dong, Dolan, Litkouhi 2017). Equal times then say nothing.
        """
        merging_yields, host_yields = self.shares
        return ArrivalHistogram(np.stack([merging_yields + host_yields.T, host_yields + merging_yields.T]))


def blurred(counts: FloatArray) -> FloatArray:
    """Smooth a table with a Gaussian kernel of one bin, as `scipy.ndimage.gaussian_filter(mode="constant")` does."""
    return _blurred_down(_blurred_down(counts).T).T


def log_ratio(probabilities: FloatArray) -> FloatArray:
    """Log of NOT_YIELD over YIELD along the first axis; 0 where either is 0."""
    known = (probabilities > 0).all(axis=0)
    logs = np.log(np.where(known, probabilities, 1.0))
    ratio: FloatArray = logs[Intention.NOT_YIELD] - logs[Intention.YIELD]
    return ratio


def _blurred_down(counts: FloatArray) -> FloatArray:
    """Smooth along the first axis, adding up from the outside in, as SciPy does: to the same last bits."""
    reach, rows = len(KERNEL) // 2, len(counts)
    padded = np.pad(counts, ((reach, reach), (0, 0)))
    smooth = counts * KERNEL[reach]
    for k in range(reach, 0, -1):
        smooth += (padded[reach - k :][:rows] + padded[reach + k :][:rows]) * KERNEL[reach + k]
    return smooth


def _normalised_rows(counts: FloatArray) -> FloatArray:
    total = counts.sum(axis=-1, keepdims=True)
    return np.divide(counts, total, out=np.zeros_like(counts), where=total > 0)


def _around(padded: FloatArray) -> FloatArray:
    rows, columns = padded.shape[1] - 2, padded.shape[2] - 2
    shifted = [padded[:, i : i + rows, j : j + columns] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    return np.sum(shifted, axis=0)

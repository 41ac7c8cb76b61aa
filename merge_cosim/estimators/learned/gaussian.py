"""Changes of speed as one Gaussian per speed bin: the transition model of PGM-G."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.units import FloatArray, IntArray

WIDE_BIN = 5.0
"""Width of a speed bin that has a Gaussian of its own [m/s]."""
WIDE_BINS = 8
ENOUGH = 10
"""Transitions that each intention needs in a bin to have its own Gaussian there: one second of one car."""
MIN_SIGMA = 0.05
"""Smallest standard deviation that is believed [m/s]."""
DIGITS = 9
"""Decimal places kept of what is fitted."""


@dataclass(frozen=True)
class SpeedGaussian:
    """`V_t | V_{t-lag}, I ~ N(V_{t-lag} + mu_I(v), sigma_I(v))`, by bins of V_{t-lag}; index 0 is YIELD, 1 NOT_YIELD.

    Attributes:
        mean_change: mu, shape (2, WIDE_BINS) [m/s].
        sigma: Standard deviations as fitted, shape (2, WIDE_BINS) [m/s]; may be 0, so see `floored`.
    """

    mean_change: FloatArray
    sigma: FloatArray

    def __post_init__(self) -> None:
        if self.mean_change.shape != (2, WIDE_BINS) or self.sigma.shape != (2, WIDE_BINS):
            raise ValueError(f"a Gaussian for each of {WIDE_BINS} speed bins is needed")
        if not (np.isfinite(self.mean_change).all() and np.isfinite(self.sigma).all() and (self.sigma >= 0).all()):
            raise ValueError("means and standard deviations must be finite")

    @classmethod
    def fit(cls, before: FloatArray, now: FloatArray, label: IntArray) -> SpeedGaussian:
        """Fit by maximum likelihood; all arguments have shape (n,).

        In a bin where either intention has fewer than `ENOUGH` transitions both take the Gaussian of that bin's
        transitions under either, or of all transitions if there are too few of these: an unseen bin says nothing.
        """
        change, bins = now - before, wide_bin(before)
        mean, sigma = np.empty((2, WIDE_BINS)), np.empty((2, WIDE_BINS))
        for i in range(WIDE_BINS):
            of_bin = bins == i
            own = [change[of_bin & (label == intention)] for intention in (Intention.YIELD, Intention.NOT_YIELD)]
            if min(map(len, own)) < ENOUGH:
                own = [change[of_bin] if of_bin.sum() >= ENOUGH else change] * 2
            mean[:, i] = [part.mean() for part in own]
            sigma[:, i] = [part.std() for part in own]
        return cls(mean.round(DIGITS), sigma.round(DIGITS))

    def floored(self, min_sigma: float = MIN_SIGMA) -> SpeedGaussian:
        """The same with no standard deviation below `min_sigma` [m/s], above 0."""
        return replace(self, sigma=np.maximum(self.sigma, min_sigma))

    @cached_property
    def _parabolas(self) -> FloatArray:
        """The log ratio in a bin is a parabola of the change of speed: coefficients of 1, d, d^2, (3, WIDE_BINS)."""
        half = 0.5 / self.sigma**2
        terms = np.stack([-np.log(self.sigma) - half * self.mean_change**2, 2 * half * self.mean_change, -half])
        return terms[:, Intention.NOT_YIELD] - terms[:, Intention.YIELD]

    def log_ratio(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """Evidence for NOT_YIELD in the transition of each car, shape (n,)."""
        constant, linear, square = self._parabolas.take(wide_bin(before), axis=1)
        change = now - before
        ratio: FloatArray = constant + change * (linear + change * square)
        return ratio

    def log_density(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """`log P(now | before, I)` per m/s, shape (2, n)."""
        bins = wide_bin(before)
        sigma = self.sigma[:, bins]
        away = (now - before - self.mean_change[:, bins]) / sigma
        density: FloatArray = -0.5 * away**2 - np.log(sigma) - 0.5 * np.log(2 * np.pi)
        return density


def wide_bin(speed: FloatArray) -> IntArray:
    """Index of the bin of each speed, clipped to the table."""
    return np.minimum(np.maximum(speed / WIDE_BIN, 0.0), WIDE_BINS - 1).astype(np.int64)

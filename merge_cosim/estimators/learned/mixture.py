"""Speed transitions as a Gaussian mixture over both speeds: the transition model of FG-GMM."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray, IntArray

COMPONENTS = 2
"""Components of the mixture (Lyu, Dong, Dolan 2020, Sec. IV-B)."""
RANDOM_STATE = 0
"""Seed of the fit's first guess."""
DIGITS = 9
"""Decimal places kept of what is fitted."""
Density = Literal["conditional", "joint"]


@dataclass(frozen=True)
class SpeedMixture:
    """A Gaussian mixture over (V_{t-lag}, V_t) for each intention; index 0 is YIELD, index 1 NOT_YIELD.

    The components are ordered by their mean speed.

    Attributes:
        weights: Shape (2, COMPONENTS).
        means: Shape (2, COMPONENTS, 2) [m/s].
        covariances: Shape (2, COMPONENTS, 2, 2) [m^2/s^2].
    """

    weights: FloatArray
    means: FloatArray
    covariances: FloatArray

    def __post_init__(self) -> None:
        expected = ((2, COMPONENTS), (2, COMPONENTS, 2), (2, COMPONENTS, 2, 2))
        if (self.weights.shape, self.means.shape, self.covariances.shape) != expected:
            raise ValueError(f"a mixture of {COMPONENTS} components for each intention is needed")
        if not (np.isfinite(self.means).all() and np.isfinite(self.covariances).all()):
            raise ValueError("means and covariances must be finite")
        if not ((self.weights > 0).all() and np.allclose(self.weights.sum(axis=1), 1.0)):
            raise ValueError("the weights of a mixture must be positive and sum to 1")
        if not (np.diagonal(self.covariances, axis1=2, axis2=3) > 0).all() or not (self._moments[2] > 0).all():
            raise ValueError("the covariances of a mixture must be positive definite")

    @classmethod
    def fit(cls, before: FloatArray, now: FloatArray, label: IntArray) -> SpeedMixture:
        """Fit by expectation maximisation (scikit-learn, full covariances); all arguments have shape (n,).

        Raises:
            UserError: There are too few transitions of an intention.
        """
        from sklearn.mixture import GaussianMixture  # imported where a model is trained: it is slow to import
        from threadpoolctl import threadpool_limits

        weights, means, covariances = [], [], []
        for intention in (Intention.YIELD, Intention.NOT_YIELD):
            speeds = np.column_stack([before, now])[label == intention]
            if (different := len(np.unique(speeds, axis=0))) < COMPONENTS:
                raise UserError(f"{different} different speed transitions of {intention.name}; a mixture needs more")
            mixture = GaussianMixture(COMPONENTS, covariance_type="full", random_state=RANDOM_STATE)
            with threadpool_limits(1):  # for matrices of 2 x 2 threads wait for each other, fifteen times the work
                fitted = mixture.fit(speeds)
            order = np.argsort(fitted.means_[:, 0], kind="stable")
            weights.append(fitted.weights_[order])
            means.append(fitted.means_[order])
            covariances.append(fitted.covariances_[order])
        return cls(*(np.stack(part).round(DIGITS) for part in (weights, means, covariances)))

    @cached_property
    def _moments(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Each component as P(before) P(now | before): slope and intercept of the latter's mean, and its variance."""
        variance, covariance = self.covariances[..., 0, 0], self.covariances[..., 0, 1]
        slope = covariance / variance
        return slope, self.means[..., 1] - slope * self.means[..., 0], self.covariances[..., 1, 1] - slope * covariance

    @cached_property
    def _terms(self) -> tuple[FloatArray, ...]:
        """What the loop needs, components first and then intentions, with a last axis for the batch."""
        slope, intercept, rest = self._moments
        variance = self.covariances[..., 0, 0]
        log_before = np.log(self.weights) - 0.5 * np.log(2 * np.pi * variance)
        log_now = -0.5 * np.log(2 * np.pi * rest)
        parts = (self.means[..., 0], 0.5 / variance, log_before, slope, intercept, 0.5 / rest, log_now)
        return tuple(np.ascontiguousarray(part.T[..., None]) for part in parts)

    def _log_sums(self, before: FloatArray, now: FloatArray) -> FloatArray:
        """Log of both mixtures at each car's speeds: [P(before), P(before, now)] by intention, shape (2, 2, n)."""
        centre, steep_before, log_before, slope, intercept, steep_now, log_now = self._terms
        logs = np.empty((COMPONENTS, 2, 2, len(before)))
        away = before - centre
        logs[:, 0] = log_before - steep_before * away * away
        away = now - (slope * before + intercept)
        np.add(logs[:, 0], log_now - steep_now * away * away, out=logs[:, 1])
        sums: FloatArray = np.logaddexp(logs[0], logs[1])
        return sums

    def log_ratio(self, before: FloatArray, now: FloatArray, density: Density = "conditional") -> FloatArray:
        """Evidence for NOT_YIELD in the transition of each car, shape (n,).

        Args:
            before: Speeds V_{t-lag} [m/s], shape (n,).
            now: Speeds V_t [m/s], shape (n,).
            density: `conditional` for P(now | before, I), which integrates to 1 over `now` (Eq. 3), or `joint` for
                P(before, now | I) (Eq. 6), which also judges how fast the car is.
        """
        sums = self._log_sums(before, now)
        ratios = sums[:, Intention.NOT_YIELD] - sums[:, Intention.YIELD]
        of_transition: FloatArray = ratios[1] - ratios[0] if density == "conditional" else ratios[1]
        return of_transition

    def log_density(self, before: FloatArray, now: FloatArray, density: Density = "conditional") -> FloatArray:
        """`log P(now | before, I)` per m/s, or `log P(before, now | I)` per m^2/s^2; shape (2, n)."""
        sums = self._log_sums(before, now)
        return sums[1] - sums[0] if density == "conditional" else sums[1]

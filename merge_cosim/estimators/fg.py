"""FG and FG-GMM: a factor graph with forgetting over the last frames (Lyu, Dong, Dolan 2020)."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import Count, FloatArray, IntArray, Share
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.evidence import LogRatio, SpeedEvidence
from merge_cosim.estimators.learned.histogram import time_bin
from merge_cosim.estimators.learned.mixture import Density
from merge_cosim.estimators.learned.model import IntentionModel


@dataclass(kw_only=True)
class FactorGraph(Estimator):
    """The factor graph that FG and FG-GMM share; they differ in f.

    Attributes:
        frames: Number n of transitions that count.
        forgetting: lambda, per frame: a transition's weight is `exp(-lambda age)`.
        last_weight: w_P, weight of the last intention.
        last_variance: sigma^2 of the last intention's factor (Eq. 4).
        time_weight: Weight of PGM's time term; the paper's graph has none and looks at no host.
        uniform: Share of the uniform distribution in the time term.
        transition_lag: Frames between the two speeds of a transition; the overlapping transitions of a longer lag are
            weighted by 1 / lag.
    """

    needs_model: ClassVar[bool] = True
    memory = ("_speeds", "_blurred")
    frames: Count = 20
    forgetting: NonNegativeFloat = 0.1
    last_weight: NonNegativeFloat = 1.0
    last_variance: PositiveFloat = 1.0
    time_weight: NonNegativeFloat = 0.0
    uniform: Share = 0.05
    transition_lag: Count = 1

    @abstractmethod
    def _log_ratio(self, model: IntentionModel) -> LogRatio:
        """Choose f."""

    def use(self, model: IntentionModel) -> None:
        """Take f, the prior and the table of the time term."""
        self._speeds = SpeedEvidence(
            self._log_ratio(model), self.transition_lag, self.frames, float(np.exp(-self.forgetting))
        )
        self._time_table = model.arrivals.log_odds(self.uniform) * self.time_weight
        self._prior = model.prior_log_odds

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the last transitions; the first belief is the prior."""
        super().start(count, setting)
        self._speeds.start(count)
        self._blurred = np.full(count, self._blur(self._prior))

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Forget the speeds and the belief at `rows`."""
        self._speeds.reset(rows)
        self._blurred[rows] = self._blur(self._prior)

    def update(self, seen: Observation) -> FloatArray:
        """Add the newest transition to the fading sum, and what the last cycle believed."""
        log_odds = self._speeds.add(seen.merging_speed) + self._blurred
        log_odds += self._prior
        if self.time_weight > 0:
            log_odds += self._time_table[time_bin(seen.merging_arrival), time_bin(seen.host_arrival)]
        self._blurred = self._blur(log_odds)
        return log_odds

    def _blur(self, log_odds: FloatArray | float) -> Any:
        """What a belief adds in the next cycle (Eq. 4): `w_P (2 P(N) - 1) / sigma^2`."""
        return (self.last_weight / self.last_variance) * np.tanh(0.5 * log_odds)


@estimators.register
@dataclass(kw_only=True)
class Fg(FactorGraph):
    """Factor graph over counted speed transitions (Lyu, Dong, Dolan 2020, Eq. 2-5).

    `log-odds = S_t + w_P (2 p_t - 1) / sigma^2 + log P(N) / P(Y)` with
    `S_t = sum_{i<n} exp(-lambda i) r_{t-i} = e^-lambda S_{t-1} + r_t - e^(-n lambda) r_{t-n}` and
    `r_t = log f(V_t, V_{t-1}; N) - log f(V_t, V_{t-1}; Y)`, f as counted.

    The forgetting weight is an exponent of f, `f^w`: Eq. 3 read literally, `w(i) f`, multiplies both intentions by the
    same w, which cancels. The blurring function of Eq. 4 is 1 for the candidate NOT_YIELD, 0 for YIELD, and
    `p_t = P(N)` of the last cycle for the last intention, so the two candidates' factors differ by the term above;
    `p_0` is the prior. Neither lambda nor sigma^2 nor the weight of the prior term P is given in the paper. The prior
    log-odds are added in every cycle as in PGM.

    Attributes:
        missing: What stands for a transition that was never counted: `background`, as in PGM, or `neighbours`, the
            mean of the cells around it (Sec. IV-B).
        epsilon: Share of the pooled background, with `missing=background`.
    """

    name: ClassVar[str] = "fg"
    missing: Literal["background", "neighbours"] = "background"
    epsilon: Share = 0.05

    def _log_ratio(self, model: IntentionModel) -> LogRatio:
        counted = model.speed(self.transition_lag).histogram
        if self.missing == "neighbours":
            return counted.with_neighbours().log_ratio
        return counted.with_background(self.epsilon).log_ratio


@estimators.register
@dataclass(kw_only=True)
class FgTime(Fg):
    """FG with PGM's time term, so that it sees the host (variant)."""

    name: ClassVar[str] = "fg-time"
    time_weight: NonNegativeFloat = 1.0


@estimators.register
@dataclass(kw_only=True)
class FgGmm(FactorGraph):
    """Factor graph over a Gaussian mixture of speed transitions (Lyu, Dong, Dolan 2020, Eq. 2-7).

    As FG, with f from a mixture of two Gaussians over (V_{t-1}, V_t) per intention. Eq. 3 calls f a conditional
    probability, Eq. 6 evaluates the joint one; `density` chooses. The joint one also asks under which intention a car
    is that fast at all, once per frame.

    Attributes:
        density: `conditional` for P(V_t | V_{t-1}, I) (Eq. 3) or `joint` for P(V_{t-1}, V_t | I) (Eq. 6).
    """

    name: ClassVar[str] = "fg-gmm"
    density: Density = "conditional"

    def _log_ratio(self, model: IntentionModel) -> LogRatio:
        return partial(model.speed(self.transition_lag).mixture.log_ratio, density=self.density)


@estimators.register
@dataclass(kw_only=True)
class FgGmmTime(FgGmm):
    """FG-GMM with PGM's time term, so that it sees the host (variant)."""

    name: ClassVar[str] = "fg-gmm-time"
    time_weight: NonNegativeFloat = 1.0


@estimators.register
@dataclass(kw_only=True)
class FgGmmJoint(FgGmm):
    """FG-GMM with the joint density of Eq. 6 (variant)."""

    name: ClassVar[str] = "fg-gmm-joint"
    density: Density = "joint"

"""PGM: a speed term over the last nodes, a time term and a prior (Dong, Dolan, Litkouhi 2017)."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

from pydantic import NonNegativeFloat

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import Count, FloatArray, IntArray, Share
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.evidence import LogRatio, SpeedEvidence
from merge_cosim.estimators.learned.histogram import time_bin
from merge_cosim.estimators.learned.model import IntentionModel


@dataclass(kw_only=True)
class GraphicalModel(Estimator):
    """The graph that PGM and PGM-G share; they differ in P(V_t | V_{t-1}, I).

    Attributes:
        nodes: Number n of speed nodes; 1 leaves only time and prior.
        alpha: Weight of the speed term. Eq. 4's alpha is P(V_1), a term common to both intentions; as a factor it
            tempers correlated evidence.
        time_weight: Weight of the time term.
        transition_lag: Cycles between the two speeds of a transition; the overlapping transitions of a longer lag are
            weighted by 1 / lag.
        uniform: Share of the uniform distribution in the time term.
        roles: `counted`: times to arrival and prior as counted (Eq. 3). `symmetric`: every pair is counted with the
            roles swapped as well, so that the prior is even and equal times to arrival say nothing.
    """

    needs_model: ClassVar[bool] = True
    memory = ("_speeds",)
    nodes: Count = 52
    alpha: NonNegativeFloat = 1.0
    time_weight: NonNegativeFloat = 1.0
    transition_lag: Count = 1
    uniform: Share = 0.05
    roles: Literal["counted", "symmetric"] = "counted"

    @abstractmethod
    def _log_ratio(self, model: IntentionModel) -> LogRatio:
        """Choose the density of the speed transitions."""

    def use(self, model: IntentionModel) -> None:
        """Make the tables of log-odds."""
        self._speeds = SpeedEvidence(self._log_ratio(model), self.transition_lag, max(self.nodes - 1, 1))
        symmetric = self.roles == "symmetric"
        arrivals = model.arrivals.symmetric() if symmetric else model.arrivals
        self._time_table = arrivals.log_odds(self.uniform) * self.time_weight
        self._prior = 0.0 if symmetric else model.prior_log_odds

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the last transitions and speeds."""
        super().start(count, setting)
        self._speeds.start(count)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Forget the speeds at `rows`."""
        self._speeds.reset(rows)

    def update(self, seen: Observation) -> FloatArray:
        """Add the newest transition, drop the oldest, look up the time term."""
        log_odds = self._time_table[time_bin(seen.merging_arrival), time_bin(seen.host_arrival)] + self._prior
        if self.nodes > 1 and self.alpha > 0:
            log_odds += self.alpha * self._speeds.add(seen.merging_speed)
        return log_odds


@estimators.register
@dataclass(kw_only=True)
class Pgm(GraphicalModel):
    """Probabilistic graphical model of the merging driver's intention (Dong, Dolan, Litkouhi 2017, Eq. 1-5).

    `log-odds = alpha sum_t r_t + [log P(T_m, T_h | N) - log P(T_m, T_h | Y)] + log P(N) / P(Y)` with
    `r_t = log P(V_t | V_{t-1}, N) - log P(V_t | V_{t-1}, Y)`. The sum runs over the last `nodes` speeds (so one
    transition fewer), over those seen so far while there are fewer, and is kept by adding the newest and dropping the
    oldest.

    Attributes:
        epsilon: Share of the pooled background in the transition probabilities.
    """

    name: ClassVar[str] = "pgm"
    epsilon: Share = 0.05

    def _log_ratio(self, model: IntentionModel) -> LogRatio:
        return model.speed(self.transition_lag).histogram.with_background(self.epsilon).log_ratio


@estimators.register
@dataclass(kw_only=True)
class PgmTime(Pgm):
    """PGM without its speed term: time and prior only (ablation)."""

    name: ClassVar[str] = "pgm-time"
    nodes: Count = 1


@estimators.register
@dataclass(kw_only=True)
class PgmSpeed(Pgm):
    """PGM without its time term: speeds and prior only (ablation)."""

    name: ClassVar[str] = "pgm-speed"
    time_weight: NonNegativeFloat = 0.0


@estimators.register
@dataclass(kw_only=True)
class PgmSymmetric(Pgm):
    """PGM that counts every training pair with the roles swapped as well (variant)."""

    name: ClassVar[str] = "pgm-symmetric"
    roles: Literal["counted", "symmetric"] = "symmetric"

"""PGM: a speed term over the last nodes, a time term and a prior (Dong, Dolan, Litkouhi 2017)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveInt

from merge_cosim.intention.base import Estimator, estimators
from merge_cosim.intention.model import IntentionModel, speed_bin, time_bin
from merge_cosim.observation import Observation, Setting
from merge_cosim.streams import Keys
from merge_cosim.units import FloatArray, IntArray

Share = Annotated[float, Field(ge=0, le=1)]


@estimators.register
@dataclass(kw_only=True)
class Pgm(Estimator):
    """Probabilistic graphical model of the merging driver's intention (Eq. 5).

    `log-odds = alpha sum_t r_t + [log P(T_m, T_h | N) - log P(T_m, T_h | Y)] + log P(N) / P(Y)` with
    `r_t = log P(V_t | V_{t-1}, N) - log P(V_t | V_{t-1}, Y)`. The sum runs over the last `nodes` speeds (so one
    transition fewer), over those seen so far while there are fewer, and is kept by adding the newest and dropping the
    oldest.

    Attributes:
        nodes: Number n of speed nodes; 1 leaves time and prior alone.
        alpha: Weight of the speed term. Eq. 4's alpha is P(V_1), a term common to both intentions; as a factor it
            tempers correlated evidence.
        time_weight: Weight of the time term.
        transition_lag: Cycles between the two speeds of a transition; the overlapping transitions of a longer lag are
            weighted by 1 / lag.
        epsilon: Share of the pooled background in the transition probabilities.
        uniform: Share of the uniform distribution in the time term.
    """

    name: ClassVar[str] = "pgm"
    needs_model: ClassVar[bool] = True
    nodes: PositiveInt = 52
    alpha: NonNegativeFloat = 1.0
    time_weight: NonNegativeFloat = 1.0
    transition_lag: PositiveInt = 1
    epsilon: Share = 0.05
    uniform: Share = 0.05

    def use(self, model: IntentionModel) -> None:
        """Make the tables of log-odds."""
        self._speed_table = model.speed_log_odds(self.transition_lag, self.epsilon) * (self.alpha / self.transition_lag)
        self._time_table = model.time_log_odds(self.uniform) * self.time_weight
        self._prior = model.prior_log_odds

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the rings of the last transitions and speeds."""
        super().start(count, setting)
        self._rows = np.arange(count)
        self._seen = np.zeros(count, dtype=np.int64)
        self._sum = np.zeros(count)
        self._terms = np.zeros((count, max(self.nodes - 1, 1)))
        self._bins = np.zeros((count, self.transition_lag), dtype=np.int64)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Empty the rings at `rows`."""
        self._seen[rows] = 0
        self._sum[rows] = 0.0
        self._terms[rows] = 0.0

    def update(self, seen: Observation) -> FloatArray:
        """Add the newest transition, drop the oldest, look up the time term."""
        if self.nodes > 1 and self.alpha > 0:
            self._update_speed_term(seen.merging_speed)
        time = self._time_table[time_bin(seen.merging_arrival), time_bin(seen.host_arrival)]
        return self._sum + time + self._prior

    def _update_speed_term(self, speed: FloatArray) -> None:
        now = speed_bin(speed)
        lag = self._seen % self.transition_lag
        before = self._bins[self._rows, lag]
        self._bins[self._rows, lag] = now
        newest = np.where(self._seen >= self.transition_lag, self._speed_table[before, now], 0.0)
        slot = self._seen % self._terms.shape[1]
        self._sum += newest - self._terms[self._rows, slot]
        self._terms[self._rows, slot] = newest
        self._seen += 1


@estimators.register
@dataclass(kw_only=True)
class PgmTime(Pgm):
    """PGM without its speed term: time and prior only (ablation)."""

    name: ClassVar[str] = "pgm-time"
    nodes: PositiveInt = 1


@estimators.register
@dataclass(kw_only=True)
class PgmSpeed(Pgm):
    """PGM without its time term: speeds and prior only (ablation)."""

    name: ClassVar[str] = "pgm-speed"
    time_weight: NonNegativeFloat = 0.0

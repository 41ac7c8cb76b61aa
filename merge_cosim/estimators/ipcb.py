"""iPCB's estimate: the intention from only the present acceleration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import PositiveFloat

from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.intended import IntendedAcceleration
from merge_cosim.estimators.learned.model import IntentionModel


@estimators.register
@dataclass(kw_only=True)
class Ipcb(IntendedAcceleration, Estimator):
    """Intention of the Prediction- and Cost-function-Based method (iPCB; Wei, Dolan, Litkouhi 2013).

    `log-odds = [(a - mu_Y)^2 - (a - mu_N)^2] / (2 sigma^2) + log P(N) / P(Y)` with `a = (V_t - V_{t-1}) / dt` and the
    same sigma for both intentions. Nothing earlier is remembered, which Dong, Dolan, Litkouhi 2017 (Fig. 3) call its
    weakness. In an encounter's first cycle there is no acceleration yet, so only the prior counts. The prior is the
    model's, as for every estimator with one.

    Attributes:
        sigma: Standard deviation of the acceleration around either mean [m/s^2].
    """

    name: ClassVar[str] = "ipcb"
    default_controller: ClassVar[str] = "pcb"
    needs_model: ClassVar[bool] = True
    memory = ("_last_speed",)
    sigma: PositiveFloat = 0.5

    def use(self, model: IntentionModel) -> None:
        """Take the prior."""
        self._prior = model.prior_log_odds

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the last speeds."""
        super().start(count, setting)
        self._last_speed = np.full(count, np.nan)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Forget the last speeds at `rows`."""
        self._last_speed[rows] = np.nan

    def update(self, seen: Observation) -> FloatArray:
        """Weigh the last cycle's acceleration."""
        acceleration = (seen.merging_speed - self._last_speed) / self.setting.dt
        self._last_speed = seen.merging_speed.copy()
        mean = self.intended(seen, self.setting.dt)
        off_yield = acceleration - mean[Intention.YIELD]
        off_not_yield = acceleration - mean[Intention.NOT_YIELD]
        evidence = (off_yield**2 - off_not_yield**2) / (2.0 * self.sigma**2)
        return np.where(np.isnan(evidence), 0.0, evidence) + self._prior

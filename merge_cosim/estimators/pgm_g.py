"""PGM-G: PGM with Gaussian speed transitions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pydantic import PositiveFloat

from merge_cosim.estimators.base import estimators
from merge_cosim.estimators.evidence import LogRatio
from merge_cosim.estimators.learned.gaussian import MIN_SIGMA
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.pgm import GraphicalModel


@estimators.register
@dataclass(kw_only=True)
class PgmG(GraphicalModel):
    """PGM whose speed transitions are Gaussian (the rival PGM-G of Dong, Dolan, Litkouhi 2017, Sec. V).

    `V_t | V_{t-1}, I ~ N(V_{t-1} + mu_I(v), sigma_I(v))` with one mu and sigma per speed bin of 5 m/s; all else is
    PGM's. The paper says no more than that the distribution is Gaussian; the bins are our reading.

    Attributes:
        min_sigma: Smallest standard deviation that is believed [m/s].
    """

    name: ClassVar[str] = "pgm-g"
    min_sigma: PositiveFloat = MIN_SIGMA

    def _log_ratio(self, model: IntentionModel) -> LogRatio:
        return model.speed(self.transition_lag).gaussian.floored(self.min_sigma).log_ratio

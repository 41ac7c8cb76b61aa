"""Slot checking: pass ahead or behind, whichever needs the smaller feasible acceleration."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, NonPositiveFloat

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import TOLERANCE, FloatArray
from merge_cosim.estimators.base import Estimator, certain, estimators


@estimators.register
@dataclass(kw_only=True)
class Slot(Estimator):
    """Slot checking after the Urban Challenge (Urmson et al. 2008; Dong, Dolan, Litkouhi 2017, Sec. V).

    Both cars are projected to the merging car's arrival `T = max(T_m, dt)`, where the host would stand at
    `p = s_h + v_h T`. The slot ahead needs `max(0, 2 (L_h + g - p) / T^2)`, the one behind
    `min(0, 2 (-L_m - g - p) / T^2)`. The smaller of the feasible ones wins; a tie, or none, means NOT_YIELD.

    Attributes:
        margin: Gap g left to the merging car at its arrival [m].
        min_acceleration: Hardest feasible braking, negative [m/s^2].
        max_acceleration: Hardest feasible acceleration [m/s^2].
    """

    name: ClassVar[str] = "slot"
    memory = ()
    margin: NonNegativeFloat = 2.0
    min_acceleration: NonPositiveFloat = -4.0
    max_acceleration: NonNegativeFloat = 2.0

    def update(self, seen: Observation) -> FloatArray:
        """Weigh the two slots."""
        horizon = np.maximum(seen.merging_arrival, self.setting.dt)
        projected = seen.host_station + seen.host_speed * horizon
        per_metre = 2.0 / horizon**2
        ahead = np.maximum((seen.host_length + self.margin - projected) * per_metre, 0.0)
        behind = np.maximum((seen.merging_length + self.margin + projected) * per_metre, 0.0)
        cost_ahead = np.where(ahead <= self.max_acceleration + TOLERANCE, ahead, np.inf)
        cost_behind = np.where(behind <= -self.min_acceleration + TOLERANCE, behind, np.inf)
        yields = cost_ahead < cost_behind - TOLERANCE
        return certain(~yields)


@estimators.register
@dataclass(kw_only=True)
class SlotTime(Estimator):
    """The slot rule reduced to times to arrival: NOT_YIELD iff `T_m <= T_h`."""

    name: ClassVar[str] = "slot-time"
    memory = ()

    def update(self, seen: Observation) -> FloatArray:
        """Compare the times to arrival."""
        return certain(seen.merging_arrival - seen.host_arrival <= TOLERANCE)

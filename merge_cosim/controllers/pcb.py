"""iPCB's planner: predict both intentions, cost a row of candidate accelerations, drive the cheapest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import controllers
from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.registry import parameters
from merge_cosim.core.units import TOLERANCE, BoolArray, Count, FloatArray
from merge_cosim.estimators.base import Estimator
from merge_cosim.estimators.intended import IntendedAcceleration


@controllers.register
@dataclass(kw_only=True)
class Pcb(IntendedAcceleration, Acc):
    """Prediction- and cost-function-based planner (after Wei, Dolan, Litkouhi 2013); the weights are ours, not Wei's.

    Candidates a from `min_acceleration` to `max_acceleration` are held over `steps * step` seconds. For either
    intention the merging car drives `a_I` (`IntendedAcceleration`) up to the merging point and keeps its speed from
    there. Speeds are `v + a t` cut to [0, v_limit], steps are Euler's as the world's. With the cost of a candidate

    `C_I(a) = progress * mean((v_limit - v) / v_limit) + comfort * (a / comfort_scale)^2
    + closeness * max_t exp(-max(gap, 0) / gap_scale) + overlap * [overlap at some t]`,

    t over the steps at which both stations are >= 0 and `gap` from bumper to bumper, the command is
    `argmin_a sum_I P(I) C_I(a)`, P(I) from the log-odds. Once the merging car is in the lane the intention is over:
    then acc's law drives with the gains of this controller (`pcb.headway`, not `acc.headway`).

    Where the estimator has intended accelerations, as ipcb has, they are the planner's, too.

    Attributes:
        candidate_step: Step between the candidates [m/s^2].
        steps: Number of steps predicted.
        step: Length of a step [s].
        progress: Weight of lost speed.
        comfort: Weight of discomfort.
        closeness: Weight of closeness.
        overlap: Weight of an overlap.
        comfort_scale: Acceleration at which discomfort is 1 [m/s^2].
        gap_scale: Gap at which closeness has fallen to 1/e [m].
    """

    name: ClassVar[str] = "pcb"
    candidate_step: Annotated[float, Field(ge=0.01)] = 0.5
    steps: Count = 12
    step: PositiveFloat = 0.5
    progress: NonNegativeFloat = 1.0
    comfort: NonNegativeFloat = 0.1
    closeness: NonNegativeFloat = 10.0
    overlap: NonNegativeFloat = 1000.0
    comfort_scale: PositiveFloat = 4.0
    gap_scale: PositiveFloat = 5.0

    def taken_from(self, estimator: Estimator) -> dict[str, Any]:
        """The intended accelerations of an estimator that has them."""
        if not isinstance(estimator, IntendedAcceleration):
            return {}
        return {name: getattr(estimator, name) for name in parameters(IntendedAcceleration)}

    def start(self, count: int, setting: Setting) -> None:
        """Lay out the candidates."""
        super().start(count, setting)
        last = self.max_acceleration + TOLERANCE
        self.candidates = np.arange(self.min_acceleration, last, self.candidate_step)
        self._counted = np.arange(1, self.steps + 1.0)[:, None, None]
        self._speed_change = self._counted * (self.step * self.candidates[:, None])
        self._comfort = (self.comfort * (self.candidates / self.comfort_scale) ** 2)[:, None]

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """The cheapest candidate; acc's law once the merging car is in the lane."""
        cost = self.costs(seen)
        not_yield = 0.5 + 0.5 * np.tanh(0.5 * log_odds)
        expected = (1.0 - not_yield) * cost[Intention.YIELD] + not_yield * cost[Intention.NOT_YIELD]
        planned = self.candidates[expected.argmin(axis=0)]
        return np.where(seen.merging_in_lane, super().command(seen, log_odds, target), planned)

    def costs(self, seen: Observation) -> FloatArray:
        """Return C_I(a), shape (2, candidates, n), the first axis indexed by `Intention`.

        The batch is the last axis everywhere, so each operation runs over it in long rows, and `max_t exp(-gap)` is
        taken as `exp(-min_t gap)`.
        """
        limit = self.setting.speed_limit
        host = np.add(self._speed_change, seen.host_speed)
        np.clip(host, 0.0, limit, out=host)
        np.cumsum(host, axis=0, out=host)
        slow = 1.0 - host[-1] * (1.0 / (self.steps * limit))
        host *= self.step
        host += seen.host_station
        merging = self._merging_stations(seen)
        # upstream of the merging point no car can be close: such steps are put out of each other's reach
        host[host < -TOLERANCE] = -np.inf
        merging[merging < -TOLERANCE] = np.inf
        # gap = |middle of the one - middle of the other| - half of both lengths
        merging += 0.5 * (seen.host_length - seen.merging_length)
        apart = merging[:, :, None, :] - host[:, None, :, :]
        np.abs(apart, out=apart)
        gap: FloatArray = apart.min(axis=0) - 0.5 * (seen.host_length + seen.merging_length)
        close = np.exp(np.maximum(gap, 0.0) * (-1.0 / self.gap_scale))
        own = self.progress * slow + self._comfort
        cost: FloatArray = own + self.closeness * close + self.overlap * (gap < -TOLERANCE)
        return cost

    def _merging_stations(self, seen: Observation) -> FloatArray:
        """Predicted stations [m], shape (steps, 2, n)."""
        gain = self.step * self.intended(seen, self.setting.dt)
        limit = self.setting.speed_limit
        unhindered = np.clip(seen.merging_speed + self._counted * gain, 0.0, limit)
        station = seen.merging_station + self.step * np.cumsum(unhindered, axis=0)
        # a_I is driven in the steps that begin before the merging point, and these come first
        before = (seen.merging_station < -TOLERANCE) * (1 + np.count_nonzero(station[:-1] < -TOLERANCE, axis=0))
        speed = np.clip(seen.merging_speed + np.minimum(self._counted, before) * gain, 0.0, limit)
        stations: FloatArray = seen.merging_station + self.step * np.cumsum(speed, axis=0)
        return stations

"""iPCB's planner: predict both intentions, cost a row of candidate accelerations, drive the cheapest."""

from __future__ import annotations

from dataclasses import dataclass, fields
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
    memory = ()  # what the last command expected is made anew by each
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

    @property
    def channels(self) -> tuple[str, ...]:
        """The number of the chosen candidate, and the expected cost of each, which has no unit."""
        return ("policy", *(f"cost {candidate:+.4g} m/s²" for candidate in self._accelerations()))

    def _accelerations(self) -> FloatArray:
        return np.arange(self.min_acceleration, self.max_acceleration + TOLERANCE, self.candidate_step)

    def start(self, count: int, setting: Setting) -> None:
        """Lay out the candidates."""
        super().start(count, setting)
        self.candidates = self._accelerations()
        self._expected, self._planning = np.zeros((len(self.candidates), 0)), np.zeros(0, dtype=np.int64)
        self._count = count
        self._changes = self.step * self.candidates
        self._comfort = (self.comfort * (self.candidates / self.comfort_scale) ** 2)[:, None]

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """The cheapest candidate; acc's law once the merging car is in the lane."""
        planned = np.zeros_like(log_odds)
        self._planning = planning = np.flatnonzero(~seen.merging_in_lane)
        if len(planning):
            cost = self.costs(Observation(*(getattr(seen, field.name)[planning] for field in fields(Observation))))
            not_yield = 0.5 + 0.5 * np.tanh(0.5 * log_odds[planning])
            self._expected = (1.0 - not_yield) * cost[Intention.YIELD] + not_yield * cost[Intention.NOT_YIELD]
            planned[planning] = self.candidates[self._expected.argmin(axis=0)]
        return np.where(seen.merging_in_lane, super().command(seen, log_odds, target), planned)

    def channel_values(self) -> FloatArray:
        """The number of the driven candidate, and the expected cost of each; NaN where acc's law drives."""
        values = np.full((1 + len(self.candidates), self._count), np.nan)
        if len(self._planning):
            values[:, self._planning] = np.vstack([self._expected.argmin(axis=0), self._expected])
        return values

    def costs(self, seen: Observation) -> FloatArray:
        """Return C_I(a), shape (2, candidates, n), the first axis indexed by `Intention`."""
        from merge_cosim.controllers.compiled.predictions import predict

        state = tuple(getattr(seen, field.name) for field in fields(Observation))
        gains = self.step * self.intended(seen, self.setting.dt)
        gap, slow = predict(state, gains, self._changes, self.steps, self.step, self.setting.speed_limit)
        close = np.exp(np.maximum(gap, 0.0) * (-1.0 / self.gap_scale))
        own = self.progress * slow + self._comfort
        cost: FloatArray = own + self.closeness * close + self.overlap * (gap < -TOLERANCE)
        return cost

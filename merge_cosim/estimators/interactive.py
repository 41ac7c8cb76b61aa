"""Interactive filter: which type of driver needs the acceleration that is observed, given where the host is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import FloatArray, IntArray, Share
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.driver_types import DRIVER_TYPES, ReactingDriver


@estimators.register
@dataclass(kw_only=True)
class Interactive(ReactingDriver, Estimator):
    """Exact filter over types of drivers (`ReactingDriver`) that react to the host, each before and after its reaction.

    The hypotheses are `yield` and `not_yield` with three margins from `min_margin` to `max_margin` each, `ignore` and
    `wait`. Each plans an acceleration `a_D` from the state of the cycle before, within what the speed limit leaves;
    before its reaction a driver keeps its speed. With `n = (V_t - V_{t-1}) / dt - a_D`, first-order noise of standard
    deviation `sigma` and time constant `correlation_time`, `rho = exp(-dt / correlation_time)`:

    `P(a | D) = (1 - outlier) N(n_t; rho n_{t-1}, sigma^2 (1 - rho^2) + white^2) + outlier / 10`.

    So a steady difference, which the noise explains, weighs little, and a sudden one much. A driver begins to act at
    the rate `1 / reaction_time`, and draws its type anew at `change_rate`.
    `P(N) = b(not_yield) + b(ignore) [T_m < T_h]`.

    Attributes:
        sigma: Standard deviation of the acceleration around what a type plans [m/s^2].
        correlation_time: Time constant of that difference [s].
        white: Standard deviation of what is added anew each cycle [m/s^2].
        outlier: Share of accelerations that say nothing.
        reaction_time: Mean time before a driver first acts [s].
        change_rate: Rate at which a driver changes the type [1/s].
        start_yield, start_not_yield, start_ignore: Shares of the types at the start; the rest waits.
        min_margin, max_margin: The margins range between these [s].
    """

    name: ClassVar[str] = "interactive"
    default_controller: ClassVar[str] = "rollout"
    sigma: PositiveFloat = 0.3
    correlation_time: PositiveFloat = 1.0
    white: NonNegativeFloat = 0.1
    outlier: Share = 0.05
    reaction_time: NonNegativeFloat = 1.0
    change_rate: NonNegativeFloat = 0.15
    start_yield: Share = 0.38
    start_not_yield: Share = 0.4
    start_ignore: Share = 0.2
    min_margin: NonNegativeFloat = 0.8
    max_margin: NonNegativeFloat = 2.0

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the beliefs."""
        from merge_cosim.estimators.compiled.type_filter import FilterLaw

        super().start(count, setting)
        self._law = self.law(setting)
        keep = float(np.exp(-setting.dt / self.correlation_time))
        innovation = float(np.sqrt(self.sigma**2 * (1 - keep**2) + self.white**2))
        self._filter_law = FilterLaw(
            keep,
            self.sigma,
            innovation,
            self.outlier,
            1.0 - float(np.exp(-setting.dt / max(self.reaction_time, 1e-9))),
            self.change_rate * setting.dt,
        )
        margins = np.linspace(self.min_margin, self.max_margin, 3)
        self._kinds = np.array([0, 0, 0, 1, 1, 1, 2, 3])
        self._hypothesis_margins = np.array([*margins, *margins, 0.0, 0.0])  # ignore and wait have none
        wait = max(1.0 - self.start_yield - self.start_not_yield - self.start_ignore, 0.0)
        self._prior = np.array([*[self.start_yield / 3] * 3, *[self.start_not_yield / 3] * 3, self.start_ignore, wait])
        self._weight = np.zeros((count, 2, len(self._kinds)))
        self._expected = np.zeros((count, len(self._kinds)))
        self._off = np.zeros((count, 2, len(self._kinds)))
        self._last_speed = np.full(count, np.nan)
        self._age = np.zeros(count, dtype=np.int64)
        self.beliefs = np.zeros((count, len(DRIVER_TYPES)))
        self.margins = np.zeros((count, len(DRIVER_TYPES)))
        self.unreacted = np.zeros(count)
        self.reset(np.arange(count), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.uint64))

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Begin with the prior at `rows`; the driver has not reacted yet."""
        self._weight[rows, 0] = self._prior
        self._weight[rows, 1] = 0.0
        self._last_speed[rows] = np.nan
        self._age[rows] = 0

    def update(self, seen: Observation) -> FloatArray:
        """Weigh the last cycle's acceleration under each type."""
        from merge_cosim.estimators.compiled.type_filter import update

        log_odds = np.empty(len(seen.merging_speed))
        update(
            seen.host_station,
            seen.host_speed,
            seen.merging_station,
            seen.merging_speed,
            seen.host_length,
            self._kinds,
            self._hypothesis_margins,
            self._prior,
            self._law,
            self._filter_law,
            self._weight,
            self._expected,
            self._off,
            self._last_speed,
            self._age,
            self.beliefs,
            self.margins,
            self.unreacted,
            log_odds,
        )
        return log_odds

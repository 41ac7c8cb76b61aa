"""Interactive filter: which type of driver needs the acceleration that is observed, given where the host is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import Count, FloatArray, IntArray, Share
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.driver_types import DRIVER_TYPES, ReactingDriver


@estimators.register
@dataclass(kw_only=True)
class Interactive(ReactingDriver, Estimator):
    """Exact filter over types of drivers (`ReactingDriver`) that react to the host, each before and after its reaction.

    The hypotheses are `yield` and `not_yield` with three margins from `min_margin` to `max_margin` each, `ignore`,
    `wait`, `accelerate` with 1/6, 1/3, 2/3 and all of `driver_max_acceleration`, and `late` from 0.4, 0.7 and all of
    `farthest_start` on. Each plans an acceleration `a_D` from the state of the cycle before, within what the speed
    limit leaves; before its reaction a driver keeps its speed. With `n = (V_t - V_{t-1}) / dt - a_D`, first-order noise
    of standard deviation `sigma` and time constant `correlation_time`, `rho = exp(-dt / correlation_time)`:

    `P(a | D) = (1 - outlier) N(n_t; rho n_{t-1}, sigma^2 (1 - rho^2) + white^2) + outlier / 10`.

    The standard deviation of the innovation is this one or `rougher`, `rougher^2`, ... times it, in `roughness_levels`
    levels whose probabilities follow from the sum of each level's evidence over the hypotheses: drivers, and sensors,
    differ in how rough they are.

    Station, speed and acceleration are those of an observer: the reported ones, and their difference, as long as the
    sensor is exact. `x_t - x_{t-1} - dt v_t` is 0 for exact reports and changes slowly for a speed that was smoothed.
    Where it changes from cycle to cycle like white noise, the noise of station and speed is estimated
    (`compiled.observer`), a Kalman filter with a randomly changing acceleration takes over, the filter over types
    begins anew, and the acceleration's variance is added to `sigma^2`. Where reports carry a time stamp, the state is
    moved on by their age at the present acceleration.

    So a steady difference, which the noise explains, weighs little, and a sudden one much. A driver begins to act at
    the rate `1 / reaction_time`, and draws its type anew at `change_rate`.
    `P(N) = b(not_yield) + (b(ignore) + b(late)) [T_m < T_h] + b(accelerate) [T_m' < T_h]`, with `T_m'` the arrival at
    the mean acceleration of that type. `evidence` is the log likelihood of what was seen before the merging point.

    Attributes:
        sigma: Standard deviation of the acceleration around what a type plans [m/s^2].
        correlation_time: Time constant of that difference [s].
        white: Standard deviation of what is added anew each cycle [m/s^2].
        outlier: Share of accelerations that say nothing.
        reaction_time: Mean time before a driver first acts [s].
        change_rate: Rate at which a driver changes the type [1/s].
        rougher: Factor between two levels of roughness.
        roughness_levels: Number of levels.
        start_yield, start_not_yield, start_ignore, start_accelerate, start_late: Shares of the types at the start; the
            rest waits.
        min_margin, max_margin: The margins range between these [s].
        farthest_start: Longest way to the merging point at which `late` begins to accelerate [m].
        exact: Changes of the reported motion's residual up to which a sensor is taken to be exact [m].
        driver_jerk: Change of an acceleration in a cycle, one standard deviation, per length of the cycle [m/s^3].
        unknown_age: Age that reports without a time stamp may have where they are not exact [s]; escapes allow for it.
    """

    name: ClassVar[str] = "interactive"
    default_controller: ClassVar[str] = "rollout"
    sigma: PositiveFloat = 0.3
    correlation_time: PositiveFloat = 1.0
    white: NonNegativeFloat = 0.1
    rougher: PositiveFloat = 2.4
    roughness_levels: Count = 4
    outlier: Share = 0.05
    reaction_time: NonNegativeFloat = 1.0
    change_rate: NonNegativeFloat = 0.15
    start_yield: Share = 0.33
    start_not_yield: Share = 0.33
    start_ignore: Share = 0.15
    start_accelerate: Share = 0.15
    start_late: Share = 0.03
    min_margin: NonNegativeFloat = 0.8
    max_margin: NonNegativeFloat = 2.0
    farthest_start: NonNegativeFloat = 50.0
    exact: PositiveFloat = 0.01
    driver_jerk: PositiveFloat = 2.0
    unknown_age: NonNegativeFloat = 0.2

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the beliefs."""
        from merge_cosim.estimators.compiled.observer import MEMORY, ObserverLaw
        from merge_cosim.estimators.compiled.type_filter import FilterLaw

        super().start(count, setting)
        self._law = self.law(setting)
        keep = float(np.exp(-setting.dt / self.correlation_time))
        innovation = float(np.sqrt(self.sigma**2 * (1 - keep**2) + self.white**2))
        self._filter_law = FilterLaw(
            keep,
            self.sigma,
            innovation,
            self.rougher,
            self.outlier,
            1.0 - float(np.exp(-setting.dt / max(self.reaction_time, 1e-9))),
            self.change_rate * setting.dt,
        )
        margins = np.linspace(self.min_margin, self.max_margin, 3)
        pulls = self.driver_max_acceleration * np.array([1, 2, 4, 6]) / 6
        ways = self.farthest_start * np.array([0.4, 0.7, 1.0])
        self._kinds = np.repeat(np.arange(len(DRIVER_TYPES)), [3, 3, 1, 1, 4, 3])
        self._traits = np.array([*margins, *margins, 0.0, 0.0, *pulls, *ways])  # ignore and wait have none
        shares = self.start_yield, self.start_not_yield, self.start_ignore, self.start_accelerate, self.start_late
        wait = max(1.0 - sum(shares), 0.0)
        self._prior = np.array([*shares[:3], wait, *shares[3:]])[self._kinds] / np.bincount(self._kinds)[self._kinds]
        self._weight = np.zeros((count, 2, len(self._kinds)))
        self._expected = np.zeros((count, len(self._kinds)))
        self._off = np.zeros((count, 2, len(self._kinds)))
        self._roughness = np.zeros((count, self.roughness_levels))
        self._age = np.zeros(count, dtype=np.int64)
        self._observer_law = ObserverLaw(
            self.exact,
            self.driver_jerk * setting.dt,
            setting.latency or 0.0,
            setting.compensated,
            self.unknown_age if setting.latency is None else 0.0,
            setting.dt,
        )
        self._reports = np.zeros((count, MEMORY))
        self._station, self._speed, self._acceleration = np.zeros((3, count))
        self.deviation, self.late = np.zeros((3, count)), np.zeros(count)
        self.beliefs = np.zeros((count, len(DRIVER_TYPES)))
        self.traits = np.zeros((count, len(DRIVER_TYPES)))
        self.unreacted = np.zeros(count)
        self.evidence = np.zeros(count)
        self.reset(np.arange(count), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.uint64))

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Begin with the prior at `rows`; the driver has not reacted yet."""
        self._reports[rows] = 0.0
        self._begin(rows)

    def _begin(self, rows: IntArray) -> None:
        self._weight[rows, 0] = self._prior
        self._weight[rows, 1] = 0.0
        self._roughness[rows] = 1.0 / self.roughness_levels
        self.evidence[rows] = 0.0
        self._age[rows] = 0

    def observed(self, seen: Observation) -> Observation:
        """What the observer takes the state to be after `update` with `seen`."""
        return replace(seen, merging_station=self._station, merging_speed=self._speed)

    def update(self, seen: Observation) -> FloatArray:
        """Weigh the last cycle's acceleration under each type."""
        from merge_cosim.estimators.compiled.observer import observe
        from merge_cosim.estimators.compiled.type_filter import update

        log_odds = np.empty(len(seen.merging_speed))
        state = self._station, self._speed, self._acceleration, self.deviation, self.late
        before = self._age.copy()
        reports = seen.merging_station.copy(), seen.merging_speed.copy()
        observe(*reports, self._observer_law, self._reports, *state, self._age)
        if np.count_nonzero(found := before > self._age):
            self._begin(np.flatnonzero(found))
        update(
            seen.host_station.copy(),  # numba compiles anew for arrays that are read-only, as those of a world are
            seen.host_speed.copy(),
            self._station,
            self._speed,
            seen.host_length,
            self._kinds,
            self._traits,
            self._prior,
            self._law,
            self._filter_law,
            self._weight,
            self._expected,
            self._off,
            self._roughness,
            self._acceleration,
            self.deviation[2],
            self._age,
            self.beliefs,
            self.traits,
            self.unreacted,
            self.evidence,
            log_odds,
        )
        return log_odds

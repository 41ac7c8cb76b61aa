"""DBN-PF: a dynamic Bayesian network of the driver's maneuver, followed by a particle filter."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import TOLERANCE, Count, FloatArray, IntArray, Share
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.particles import Cloud, Dice, low_variance

if TYPE_CHECKING:
    from merge_cosim.estimators.compiled.particle_filter import ActionLaw, FilterLaw


OVER = -(1 << 60)
"""Age of an encounter that is over: it never comes to an update."""


class Maneuver(IntEnum):
    """How the driver of the merging car treats the host."""

    YIELD = 0
    NOT_YIELD = 1
    IGNORE = 2


@dataclass(frozen=True)
class Step:
    """One update of m encounters, as a figure shows it.

    Attributes:
        rows: Which encounters of the batch, shape (m,).
        before: Particles after the update before.
        between: Particles moved to the present, not yet weighted.
        weights: Their weights, each row summing to 1, shape (m, M).
        after: Particles resampled and in part redrawn.
        belief: Share of each maneuver, shape (3, m).
    """

    rows: IntArray
    before: Cloud
    between: Cloud
    weights: FloatArray
    after: Cloud
    belief: FloatArray


@estimators.register
@dataclass(kw_only=True)
class DbnPf(Estimator):
    """Particle filter over state and maneuver (DBN-PF blog post, after Schulz et al. 2018).

    A particle is (s, v, maneuver). In the time T that the host needs to the merging point at its present speed (at
    least `min_arrival`), constant accelerations `a_Y = 2 (-(L_h + pad) - s - v T) / T^2` and
    `a_B = 2 (L_m + pad - s - v T) / T^2` bring the car just behind or just ahead. With
    `a_free = clip(k_free (v_des - v))` the action model drives `min(a_free, a_Y)` under YIELD, `max(a_free, a_B)`
    under NOT_YIELD, `a_free` under IGNORE, clipped, plus Gaussian noise. v_des is the mean speed of the training cars
    at the merge. Steps are those of the world at constant acceleration over the update's interval tau, `v' = max(v +
    a tau, 0)`, `s' = s + v tau + (v' - v) (tau + dt) / 2`. Weights `N(s_obs; s, sigma_s) N(v_obs; v, sigma_v)` are
    kept as logarithms, then low-variance resampling.

    `P(N) = w_N + w_I [T_m < T_h]`, since a driver that ignores the host keeps the speed, clipped to [1/(2M),
    1 - 1/(2M)]; held between updates. Where a_free meets a constraint, that maneuver drives as IGNORE does, and the two
    cannot be distinguished. Unlike the blog's, the filter lets maneuvers change, as its author asks for. The blog's
    sentence that an observed acceleration shifts the particles toward yielding contradicts the sentence before it; here
    it shifts them away.

    Attributes:
        particles: Number M of particles.
        interval: Time between updates tau [s], rounded to whole cycles.
        pad: Distance beyond the bumpers that a_Y and a_B leave [m].
        min_arrival: Shortest T [s].
        k_free: Gain of free driving [1/s].
        min_acceleration, max_acceleration: Bounds of the mean acceleration [m/s^2].
        acceleration_noise: Its standard deviation [m/s^2].
        sigma_station: Standard deviation of the observed station [m].
        sigma_speed: Standard deviation of the observed speed [m/s].
        start_yield, start_not_yield: Shares of the maneuvers at the start; the rest ignores.
        change_rate: Rate at which a driver changes the maneuver, to either other one alike [1/s].
        redrawn: Share of the particles drawn anew at the observation, maneuvers by the present belief.
    """

    name: ClassVar[str] = "dbn-pf"
    needs_model: ClassVar[bool] = True
    particles: Count = 200
    interval: PositiveFloat = 0.5
    pad: NonNegativeFloat = 2.0
    min_arrival: PositiveFloat = 0.5
    k_free: PositiveFloat = 0.4
    min_acceleration: float = -4.0
    max_acceleration: float = 3.0
    acceleration_noise: NonNegativeFloat = 0.5
    sigma_station: PositiveFloat = 0.5
    sigma_speed: PositiveFloat = 0.3
    start_yield: Share = 0.4
    start_not_yield: Share = 0.4
    change_rate: NonNegativeFloat = 0.05
    redrawn: Share = 0.05

    def __post_init__(self) -> None:
        if self.start_yield + self.start_not_yield > 1.0 + TOLERANCE:
            raise ValueError("start_yield and start_not_yield are more than 1 together")
        if self.min_acceleration > self.max_acceleration:
            raise ValueError("min_acceleration is above max_acceleration")

    @property
    def start_belief(self) -> FloatArray:
        """Shares of the maneuvers before anything is seen, shape (3,)."""
        rest = max(1.0 - self.start_yield - self.start_not_yield, 0.0)
        return np.array([self.start_yield, self.start_not_yield, rest])

    _watched = False

    def watch(self) -> None:
        """Keep the whole of each update in `last_step`, for a figure."""
        self._watched = True
        self.last_step: Step | None = None

    def use(self, model: IntentionModel) -> None:
        """Take the speed that drivers merge at."""
        self._desired_speed = model.merge_speed

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the clouds and the streams."""
        super().start(count, setting)
        self._cycles = max(round(self.interval / setting.dt), 1)
        self._tau = self._cycles * setting.dt
        self._change = -np.expm1(-self.change_rate * self._tau)
        self._new = round(self.redrawn * self.particles)
        self._age = np.zeros(count, dtype=np.int64)
        self._cloud = Cloud.empty(count, self.particles)
        self._dice = Dice(count)
        self._arrival = np.zeros(count)
        self._log_odds = np.zeros(count)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Begin new streams; the clouds are drawn at the first observation."""
        self._age[rows] = 0
        self._dice.reset(rows, keys)

    def rest(self, rows: IntArray) -> None:
        """Move no more particles."""
        self._age[rows] = OVER

    def update(self, seen: Observation) -> FloatArray:
        """Start the new encounters, update those that are due, hold the others."""
        merging, host = seen.merging_arrival, seen.host_arrival
        first = np.flatnonzero(self._age == 0)
        if len(first):
            belief = np.repeat(self.start_belief[:, None], len(first), axis=1)
            self._cloud.put(first, self._drawn_at(seen, first, belief))
            self._keep(first, belief, merging, host)
        due = np.flatnonzero((self._age > 0) & (self._age % self._cycles == 0))
        if len(due):
            self._keep(due, self._step(seen, due), merging, host)
        self._age += 1
        return self._log_odds.copy()

    def mean_acceleration(
        self, cloud: Cloud, arrival: FloatArray, host_length: FloatArray, merging_length: FloatArray
    ) -> FloatArray:
        """The action model without its noise [m/s^2].

        Args:
            cloud: Particles of n encounters.
            arrival: The host's time to arrival [s], shape (n,).
            host_length: The host's length [m], shape (n,).
            merging_length: The merging car's length [m], shape (n,).

        Returns:
            Shape (n, M).
        """
        from merge_cosim.estimators.compiled.particle_filter import mean_accelerations

        mean: FloatArray = mean_accelerations(
            cloud.maneuver, cloud.station, cloud.speed, arrival, host_length, merging_length, self._action_law()
        )
        return mean

    def _action_law(self) -> ActionLaw:
        from merge_cosim.estimators.compiled.particle_filter import ActionLaw

        bounds = float(self.min_acceleration), float(self.max_acceleration)
        return ActionLaw(
            float(self._desired_speed), float(self.min_arrival), float(self.pad), float(self.k_free), *bounds
        )

    def _filter_law(self) -> FilterLaw:
        from merge_cosim.estimators.compiled.particle_filter import FilterLaw

        return FilterLaw(
            tau=self._tau,
            half=0.5 * (self._tau + self.setting.dt),
            change=float(self._change),
            acceleration_noise=float(self.acceleration_noise),
            sigma_station=float(self.sigma_station),
            sigma_speed=float(self.sigma_speed),
            new=self._new,
        )

    def _step(self, seen: Observation, rows: IntArray) -> FloatArray:
        """Drive towards where the host stood and how it drove before, weigh, resample; returns the belief, (3, m)."""
        from merge_cosim.estimators.compiled.particle_filter import Particles, Scene, step

        held = len(rows) if self._watched else 1
        between, weights = Cloud.empty(held, self.particles), np.empty((held, self.particles))
        belief = np.empty((len(Maneuver), len(rows)))
        whole, moved = (Particles(cloud.station, cloud.speed, cloud.maneuver) for cloud in (self._cloud, between))
        own = (seen.host_length, seen.merging_length, seen.merging_station, seen.merging_speed)
        scene = Scene(self._arrival[rows], *(values[rows] for values in own))
        keys, drawn = self._dice.streams(rows)
        before = self._cloud.take(rows) if self._watched else None
        step(whole, rows, scene, keys, drawn, self._action_law(), self._filter_law(), moved, weights, belief)
        self._dice.went_on(rows, drawn)
        if before is not None:
            self.last_step = Step(rows, before, between, weights, self._cloud.take(rows), belief)
        return belief

    def _drawn_at(self, seen: Observation, rows: IntArray, belief: FloatArray) -> Cloud:
        """Particles around what is observed, maneuvers by the belief."""
        count = self.particles
        noise = self._dice.normal(rows, 2 * count)
        station = seen.merging_station[rows, None] + self.sigma_station * noise[:, :count]
        speed = np.maximum(seen.merging_speed[rows, None] + self.sigma_speed * noise[:, count:], 0.0)
        maneuver = low_variance(np.ascontiguousarray(belief.T), self._dice.uniform(rows, 1)[:, 0], count)
        return Cloud(station, speed, maneuver)

    def _keep(self, rows: IntArray, belief: FloatArray, merging: FloatArray, host: FloatArray) -> None:
        self._arrival[rows] = host[rows]
        earlier = merging[rows] - host[rows] < -TOLERANCE
        not_yield = belief[Maneuver.NOT_YIELD] + np.where(earlier, belief[Maneuver.IGNORE], 0.0)
        least = 0.5 / self.particles
        not_yield = np.clip(not_yield, least, 1.0 - least)
        self._log_odds[rows] = np.log(not_yield) - np.log1p(-not_yield)

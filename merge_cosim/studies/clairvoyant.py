"""The smallest delay of a host that knows what the merging driver will do: a beam search over the host's accelerations.

The drivers react, so every path is driven against the model of the merging car itself, cycle by cycle, with the case's
own script and noise. A plan holds one acceleration of `Search.levels` for `Search.hold` cycles. From one hold to the
next each case keeps `Search.beam` states: those that could still arrive first, and a spread of all others. Plans
that are found can be driven, so their delay is never too small; full throttle, which no host can beat, bounds how far
it may be too large.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from merge_cosim.controllers.base import Controller
from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import DECIMALS, Observation, Setting
from merge_cosim.core.random_streams import Keys, stream_keys
from merge_cosim.core.units import DT, TOLERANCE, BoolArray, FloatArray, IntArray
from merge_cosim.estimators.base import Estimator
from merge_cosim.estimators.references import AlwaysYield
from merge_cosim.merging_cars.base import MergingCar
from merge_cosim.results.rows import free_time
from merge_cosim.scoring.rules import Rules, expected_cycles
from merge_cosim.scoring.scoring import GOAL
from merge_cosim.simulation.host_driver import HostDriver

ROWS = 30_000
"""Paths driven side by side: they fit the cache."""
ALIKE = 0.5
"""States of one case that agree to this [m, m/s] are taken for one."""


@dataclass(frozen=True)
class Search:
    """Resolution of the search for plans.

    Attributes:
        levels: Accelerations [m/s^2], rising; the last is full throttle.
        hold: Cycles for which one is held.
        beam: States kept per case.
    """

    levels: tuple[float, ...] = (-4.0, -2.0, -1.0, -0.5, 0.0, 1.0, 2.0)
    hold: int = 3
    beam: int = 256


@dataclass(frozen=True)
class Plans:
    """What each of n hosts will do.

    Attributes:
        accelerations: Shape (n, holds) [m/s^2].
        hold: Cycles for which one is held.
        arrival: When the host is at `GOAL` [s], shape (n,); inf where no plan was found.
    """

    accelerations: FloatArray
    hold: int
    arrival: FloatArray

    def driver(self, encounters: Encounters) -> HostDriver:
        """What drives the encounters by their plans in a `Loop` with seed 0."""
        keys = stream_keys(encounters.case, 0)
        return HostDriver(_Numbered(keys=keys), _Planned(plans=self))


def search_plans(
    encounters: Encounters, merging_car: MergingCar, rules: Rules, setting: Setting, search: Search, wanted: IntArray
) -> Plans:
    """Search the plan of each case that arrives earliest without a failure.

    Args:
        encounters: The n cases.
        merging_car: How the merging cars drive; what it remembers may depend only on case and cycle.
        rules: When an encounter is scored.
        setting: Speed limit and cycle.
        search: How finely.
        wanted: Indices of the cases to be searched.

    Returns:
        The plans; full throttle where one is over, where none was found, and of the other cases.
    """
    levels, holds = np.array(search.levels), -(-rules.time_out_cycles // search.hold)
    arrival, plan = np.full(len(encounters), np.inf), np.full((len(encounters), holds), levels[-1])
    together = max(ROWS // (search.beam * len(levels)), 1)
    order = wanted[np.argsort(expected_cycles(encounters, rules)[wanted], kind="stable")]  # neighbours end together
    for first in range(0, len(order), together):
        cases = order[first : first + together]
        arrival[cases], chosen = _searched(encounters.take(cases), merging_car, rules, setting, search)
        plan[cases] = levels[chosen]
    return Plans(plan, search.hold, arrival)


def speed_after(speed: FloatArray, acceleration: FloatArray, setting: Setting) -> FloatArray:
    """Speeds after a cycle [m/s]: those of the accelerations, not above the limit and not below 0."""
    return np.clip(speed + acceleration * setting.dt, 0.0, np.maximum(speed, setting.speed_limit))


@dataclass(kw_only=True)
class _Numbered(AlwaysYield):
    """Knows which case drives where."""

    keys: Keys

    def start(self, count: int, setting: Setting) -> None:
        super().start(count, setting)
        self.case = np.zeros(count, dtype=np.int64)
        self._order = np.argsort(self.keys)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        self.case[rows] = self._order[np.searchsorted(self.keys, keys, sorter=self._order)]


@dataclass(kw_only=True)
class _Planned(Controller):
    """Drives by plans."""

    plans: Plans

    def pair(self, estimator: Estimator) -> None:
        assert isinstance(estimator, _Numbered)
        self._numbered = estimator

    def start(self, count: int, setting: Setting) -> None:
        super().start(count, setting)
        self._age = np.zeros(count, dtype=np.int64)

    def reset(self, rows: IntArray) -> None:
        self._age[rows] = 0

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        planned = self.plans.accelerations
        hold = np.minimum(self._age // self.plans.hold, planned.shape[1] - 1)
        self._age += 1
        wanted = planned[self._numbered.case, hold]
        return (speed_after(seen.host_speed, wanted, self.setting) - seen.host_speed) / self.setting.dt


@dataclass
class _Paths:
    """Paths under way, a row per case; every array but the first has the shape (cases, paths).

    Attributes:
        state: Stations of host and merging car [m], then their speeds [m/s], shape (4, cases, paths).
        until: Cycle at which scoring ends; `NEVER` before it begins.
        goal: Time at which the host passed `GOAL` [s], interpolated; inf before.
        open: Neither failed nor at the end of scoring.
        cost: Of a path that passed: its time of arrival [s]; inf for the others.
    """

    state: FloatArray
    until: IntArray
    goal: FloatArray
    open: BoolArray
    cost: FloatArray

    def each(self, places: IntArray) -> _Paths:
        """The paths at some places of their rows, shape (cases, paths)."""
        values = (getattr(self, field.name) for field in fields(self))
        return _Paths(*(np.take_along_axis(v, places[(None,) * (v.ndim - 2)], -1) for v in values))


def _searched(
    encounters: Encounters, car: MergingCar, rules: Rules, setting: Setting, search: Search
) -> tuple[FloatArray, IntArray]:
    """Search some cases side by side; the plans as numbers of levels."""
    n, levels = len(encounters), np.array(search.levels)
    wide, last = search.beam * len(levels), rules.time_out_cycles
    car.start(encounters, n * wide, setting)
    car.reset(np.arange(n * wide), np.repeat(np.arange(n), wide))
    latest = np.full(n, NEVER) if encounters.log is None else encounters.log.score_until
    latest = np.minimum(latest, last)[:, None]
    lengths = [np.repeat(length, wide) for length in encounters.start[4:]]
    one = np.ones((n, search.beam))
    alive = np.arange(search.beam) < one  # at first a single state
    paths = _Paths(
        encounters.start[:4, :, None] * one, (NEVER * one).astype(np.int64), np.inf * one, alive, np.inf * one
    )
    history = np.zeros((n, search.beam, 0), dtype=np.int64)
    holds = -(-last // search.hold)
    arrival, found = np.full(n, np.inf), np.full((n, holds), len(levels) - 1)
    every = np.repeat(np.arange(search.beam), len(levels))[None].repeat(n, axis=0)
    level = np.tile(np.arange(len(levels)), (n, search.beam))
    for hold in range(holds):
        paths = paths.each(every)
        for cycle in range(hold * search.hold, min((hold + 1) * search.hold, last)):
            _drive(paths, cycle, levels[level], car, lengths, latest, rules, setting)
        history = np.concatenate([np.take_along_axis(history, every[..., None], 1), level[..., None]], axis=2)
        best = paths.cost.argmin(axis=1)[:, None]
        better = np.take_along_axis(paths.cost, best, 1)[:, 0] < arrival
        arrival[better] = np.take_along_axis(paths.cost, best, 1)[better, 0]
        found[better, : hold + 1] = np.take_along_axis(history, best[..., None], 1)[better, 0]
        bound = np.minimum(
            paths.goal, (hold + 1) * search.hold * DT + _earliest(paths.state[0], paths.state[2], setting, levels[-1])
        )
        bound[~paths.open | (bound >= arrival[:, None])] = np.inf
        chosen = _chosen(bound, paths, search.beam)
        history = np.take_along_axis(history, chosen[..., None], 1)
        paths = paths.each(chosen)
        paths.open &= np.isfinite(np.take_along_axis(bound, chosen, 1))
        if not paths.open.any():
            break
    return arrival, found


def _drive(
    paths: _Paths,
    cycle: int,
    acceleration: FloatArray,
    car: MergingCar,
    lengths: list[FloatArray],
    latest: IntArray,
    rules: Rules,
    setting: Setting,
) -> None:
    """Drive all paths by one cycle and close those that are over."""
    state = paths.state
    shape = paths.goal.shape
    before = state.round(DECIMALS)
    now = Observation(*before[[0, 2, 1, 3]].reshape(4, -1), *lengths)
    state[2] = speed_after(before[2], acceleration, setting)
    state[3] = car.next_speed(np.full(now.host_speed.shape, cycle), now).reshape(shape)
    state[:2] += state[2:] * DT
    seen = state.round(DECIMALS)
    now = Observation(*seen[[0, 2, 1, 3]].reshape(4, -1), *lengths)
    begins = rules.begun(now).reshape(shape) & (paths.until == NEVER)
    paths.until[begins] = cycle + 1 + rules.horizon_cycles
    passes = np.isinf(paths.goal) & (seen[0] >= GOAL - TOLERANCE)
    part = (GOAL - before[0][passes]) / (seen[0][passes] - before[0][passes])
    paths.goal[passes] = (cycle + np.clip(part, 0.0, 1.0)) * DT
    fails = (paths.until < NEVER) & (now.gap.reshape(shape) < -TOLERANCE)
    ends = paths.open & ~fails & (cycle + 1 >= np.minimum(paths.until, latest))
    if ends.any():
        rest = free_time(seen[0][ends], seen[2][ends], setting, rules.free)
        paths.cost[ends] = np.minimum(paths.goal[ends], (cycle + 1) * DT + rest)
    paths.open &= ~(fails | ends)


def _earliest(station: FloatArray, speed: FloatArray, setting: Setting, acceleration: float) -> FloatArray:
    """Time [s] to `GOAL` by full throttle up to the limit, no more than a hundredth too small; 0 if past it."""
    way, half = np.maximum(GOAL - station, 0.0), 0.5 * acceleration * setting.dt
    start, limit = speed + half, np.maximum(speed, setting.speed_limit)  # the speed of a cycle is that of its end
    until = (limit - speed) / acceleration
    gained = (start + 0.5 * acceleration * until) * until
    within = 2.0 * way / (start + np.sqrt(start**2 + 2.0 * acceleration * way))
    return np.where(way <= gained, within, until + (way - gained) / limit)


def _chosen(bound: FloatArray, paths: _Paths, count: int) -> IntArray:
    """Places of the paths to keep in each case, shape (cases, count): one of those alike, by bound and by a spread."""
    by_bound = np.argsort(bound, axis=1, kind="stable")
    cell = np.minimum(paths.until, 2**18)
    for value in paths.state:
        cell = cell * 2048 + np.floor(value / ALIKE).astype(np.int64) % 2048
    key = np.take_along_axis(cell, by_bound, 1)
    by_key = np.argsort(key, axis=1, kind="stable")
    ordered = np.take_along_axis(key, by_key, 1)
    again = np.zeros_like(by_key, dtype=bool)
    again[:, 1:] = ordered[:, 1:] == ordered[:, :-1]
    left = np.take_along_axis(bound, by_bound, 1)
    repeated = np.empty_like(again)
    np.put_along_axis(repeated, by_key, again, 1)
    left[repeated] = np.inf
    front = np.argsort(~np.isfinite(left), axis=1, kind="stable")  # those left, still by bound
    alive = np.isfinite(left).sum(axis=1)[:, None]
    half = count // 2
    spread = half + (np.arange(count - half) * np.maximum(alive - half, count - half)) // (count - half)
    places = np.concatenate([np.broadcast_to(np.arange(half), (len(bound), half)), spread], axis=1)
    return np.take_along_axis(by_bound, np.take_along_axis(front, places, 1), 1)

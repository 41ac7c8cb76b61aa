"""A driver with a hidden intention: to yield, not to yield, or to ignore the host; the intention may change.

Used in this project's own Designed Test III: estimates are compared with the driver's intention, and early decisions
matter, because the driver reacts to the host.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import NegativeFloat, NonNegativeFloat, PositiveFloat

from merge_cosim.controllers.law import DistanceKeeping
from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import normal, stream_keys, uniform
from merge_cosim.core.units import TOLERANCE, FloatArray, IntArray, Share
from merge_cosim.merging_cars.ahead import host_ahead
from merge_cosim.merging_cars.base import MergingCar, merging_cars

IGNORE = int(Intention.UNKNOWN)
"""Intention of a driver that ignores the host: the order follows from the two arrivals."""
_TYPES = np.array([Intention.YIELD, Intention.NOT_YIELD, IGNORE])
_NEAR = 0.1
"""Way [m] below which a planned acceleration is no longer computed from the way left."""


@dataclass(frozen=True)
class Script:
    """What each driver will do; every array has shape (n,).

    Attributes:
        first, last: Intention at the start and in the end (`Intention`, or `IGNORE`).
        changes_at: Station [m] at which the first gives way to the last; inf without a change.
        reaction: Time [s] of constant speed at the start.
        margin: Time [s] by which the driver plans to arrive after or before the host.
    """

    first: IntArray
    last: IntArray
    changes_at: FloatArray
    reaction: FloatArray
    margin: FloatArray


@merging_cars.register
@dataclass(kw_only=True)
class Hidden(DistanceKeeping, MergingCar):
    """Plans to arrive a margin after (yield) or before (not yield) the host, anew in every cycle, with some noise.

    Constant speed for a reaction time; then the smallest constant acceleration that brings the car to the merging point
    at least the margin after, or before, a host at constant speed; 0 if the present speed does. A driver that ignores
    the host holds the speed. Once the host has passed the merging point (with IGNORE: once the car itself has), the
    driver keeps distance to a host ahead and drives freely without one. First-order noise is added to the
    acceleration after the reaction time.

    Attributes:
        seed: Seed of the scripts and of the noise.
        yield_share, not_yield_share: Shares of the two types; the others ignore the host.
        change_share: Share of drivers that change to another type, once, at a station uniform between their start and
            `change_before`; the new type is drawn from the other two in proportion to their shares.
        change_before: Way to the merging point [m] within which no driver changes.
        max_reaction: The reaction time is uniform from 0 to this [s].
        min_margin, max_margin: The margin is uniform between these [s].
        sigma: Standard deviation of the noise [m/s^2].
        time_constant: Its time constant [s].
        headway: Time headway to a host ahead [s].
        min_acceleration, max_acceleration: Bounds of the planned and of the driven acceleration [m/s^2].
    """

    name: ClassVar[str] = "hidden"
    seed: int = 0
    yield_share: Share = 0.4
    not_yield_share: Share = 0.4
    change_share: Share = 0.2
    change_before: NonNegativeFloat = 20.0
    max_reaction: NonNegativeFloat = 2.0
    min_margin: NonNegativeFloat = 0.8
    max_margin: NonNegativeFloat = 2.0
    sigma: NonNegativeFloat = 0.3
    time_constant: PositiveFloat = 1.0
    headway: NonNegativeFloat = 0.8
    min_acceleration: NegativeFloat = -4.0
    max_acceleration: PositiveFloat = 3.0

    def __post_init__(self) -> None:
        """Check what must fit together."""
        if self.yield_share + self.not_yield_share > 1.0 + TOLERANCE:
            raise ValueError("yield_share and not_yield_share are more than 1 together")
        if self.min_margin > self.max_margin:
            raise ValueError("min_margin is above max_margin")

    def script(self, encounters: Encounters) -> Script:
        """Draw what the drivers of some encounters will do; a case's script depends only on its name."""
        n = len(encounters)
        keys = stream_keys(np.array([f"driver/{case}" for case in encounters.case]), self.seed)
        u = uniform(keys, np.zeros(n, dtype=np.int64), 6)
        shares = np.array([self.yield_share, self.not_yield_share, 1.0 - self.yield_share - self.not_yield_share])
        first = (u[:, 0] > shares[0]).astype(np.int64) + (u[:, 0] > shares[0] + shares[1])
        others = np.stack([(first + 1) % 3, (first + 2) % 3])
        weight = shares[others[0]], shares[others[1]]
        other = np.where(u[:, 4] * (weight[0] + weight[1]) <= weight[0], others[0], others[1])
        from_station = encounters.merging_station
        change_station = from_station + u[:, 5] * (-self.change_before - from_station)
        changes = (u[:, 3] < self.change_share) & (from_station < -self.change_before) & (weight[0] + weight[1] > 0)
        return Script(
            first=_TYPES[first],
            last=_TYPES[np.where(changes, other, first)],
            changes_at=np.where(changes, change_station, np.inf),
            reaction=self.max_reaction * u[:, 1],
            margin=self.min_margin + (self.max_margin - self.min_margin) * u[:, 2],
        )

    def intentions(self, encounters: Encounters) -> IntArray:
        """The final intention: YIELD, NOT_YIELD, or UNKNOWN for a driver that ignores the host."""
        return self.script(encounters).last

    def start(self, encounters: Encounters, count: int, setting: Setting) -> None:
        """Draw the scripts."""
        super().start(encounters, count, setting)
        self._script = self.script(encounters)
        names = np.array([f"noise/{case}" for case in encounters.case])
        self._case_keys = stream_keys(names, self.seed)
        self._keys = np.zeros(count, dtype=np.uint64)
        self._noise = np.zeros(count)
        self._first, self._last = (np.full(count, IGNORE) for _ in range(2))
        self._changes_at, self._reaction, self._margin = (np.full(count, np.inf) for _ in range(3))

    def reset(self, rows: IntArray, cases: IntArray) -> None:
        """Copy the scripts of the new encounters to their rows."""
        self._keys[rows] = self._case_keys[cases]
        self._first[rows], self._last[rows] = self._script.first[cases], self._script.last[cases]
        self._changes_at[rows] = self._script.changes_at[cases]
        self._reaction[rows], self._margin[rows] = self._script.reaction[cases], self._script.margin[cases]
        start = normal(self._keys[rows], np.zeros(len(rows), dtype=np.int64), 1)[:, 0]
        self._noise[rows] = self.sigma * start  # the stationary distribution

    def next_speed(self, age: IntArray, now: Observation) -> FloatArray:
        """One step: the plan, or distance keeping, and the noise."""
        dt = self.setting.dt
        intention = np.where(now.merging_station >= self._changes_at, self._last, self._first)
        ignores = intention == IGNORE
        passed = np.where(ignores, now.merging_station, np.maximum(now.host_station, now.merging_station)) >= -TOLERANCE
        plan = np.where(ignores, 0.0, self.plan(now, intention))
        wanted = np.where(passed, self._behind_or_free(now), plan)
        keep = float(np.exp(-dt / self.time_constant))
        fresh = normal(self._keys, age + 1, 1)[:, 0]
        self._noise = keep * self._noise + self.sigma * float(np.sqrt(1.0 - keep**2)) * fresh
        acceleration = np.where(age * dt < self._reaction, 0.0, self.clip(wanted + self._noise))
        return np.clip(now.merging_speed + acceleration * dt, 0.0, self.setting.speed_limit)

    def plan(self, now: Observation, intention: IntArray) -> FloatArray:
        """The smallest constant acceleration [m/s^2] to arrive the margin after or before the host, within the bounds.

        From `d = v T + a T^2 / 2`; where that law would stop the car before the point, it stops at the point.
        """
        yields = intention == Intention.YIELD
        time = np.where(yields, now.host_arrival + self._margin, now.host_arrival - self._margin)
        time = np.maximum(time, self.setting.dt)
        way, speed = np.maximum(-now.merging_station, _NEAR), now.merging_speed
        even = 2.0 * (way - speed * time) / time**2
        stop = -(speed**2) / (2.0 * way)
        needed = np.where(speed * time > 2.0 * way, stop, even)
        return self.clip(np.where(yields, np.minimum(needed, 0.0), np.maximum(needed, 0.0)))

    def _behind_or_free(self, now: Observation) -> FloatArray:
        limit = self.setting.speed_limit
        return self.drive(*host_ahead(now, "any"), now.merging_speed, now.host_speed, limit)

"""When an encounter is scored, and when its scoring ends: one rule for every world."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from merge_cosim.controllers.law import FreeDriving
from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import DT, TOLERANCE, BoolArray, FloatArray, IntArray

USUAL_ACCELERATION = 1.0
"""Acceleration [m/s^2] that the estimate of a case's length assumes."""

_Seconds = Annotated[float, Field(gt=0, le=3600)]  # every cycle of it is kept in memory


@dataclass(frozen=True)
class Rules:
    """When an encounter is scored.

    Attributes:
        horizon: Time [s] scored from the first cycle on in which both cars have reached the merging point.
        time_out: Longest run [s].
        overlap_from: `both`: scored once both cars are past the merging point; `lane_change`: once the merging car is.
        free: The free driving that delays are measured against, whatever method drives.
    """

    horizon: _Seconds = 3.0
    time_out: _Seconds = 40.0
    overlap_from: Literal["both", "lane_change"] = "both"
    free: FreeDriving = field(default_factory=FreeDriving)

    @property
    def horizon_cycles(self) -> int:
        """Cycles of the horizon."""
        return round(self.horizon / DT)

    @property
    def time_out_cycles(self) -> int:
        """Cycles of the longest run."""
        return round(self.time_out / DT)

    def begun(self, now: Observation) -> BoolArray:
        """Where both cars are far enough for scoring to begin."""
        if self.overlap_from == "both":
            return np.minimum(now.host_station, now.merging_station) >= -TOLERANCE
        return now.merging_in_lane


def end_of(states: Observation, rules: Rules) -> int:
    """The cycle in which an encounter was over, by the rules of `Watch`; its record may go on after it.

    Args:
        states: Its states from the first on, shape (N,) each.
        rules: When it is scored.
    """
    begun = rules.begun(states)
    begun[0] = False
    start = int(begun.argmax()) if begun.any() else NEVER
    failed = np.flatnonzero(states.gap[start:] < -TOLERANCE)
    first = start + int(failed[0]) if len(failed) else NEVER
    return min(start + rules.horizon_cycles, first, len(begun) - 1, rules.time_out_cycles)


def expected_cycles(encounters: Encounters, rules: Rules) -> FloatArray:
    """Rough length of each case: both cars accelerate to the merging point, then it is scored; shape (n,)."""
    arrivals = [
        (np.sqrt(speed**2 + 2 * USUAL_ACCELERATION * np.maximum(-station, 0.0)) - speed) / USUAL_ACCELERATION
        for station, speed in (
            (encounters.host_station, encounters.host_speed),
            (encounters.merging_station, encounters.merging_speed),
        )
    ]
    expected: FloatArray = np.minimum(np.maximum(*arrivals) + rules.horizon, rules.time_out) / DT
    return expected


class Watch:
    """Finds, cycle by cycle, which encounters of a batch are over, in every world."""

    def __init__(self, count: int, rules: Rules) -> None:
        self._rules = rules
        self._horizon, self._time_out = rules.horizon_cycles, rules.time_out_cycles
        self._until = np.full(count, NEVER)
        self._scored = np.zeros(count, dtype=bool)

    def make_room(self, count: int) -> None:
        """Grow to `count` slots."""
        more = count - len(self._until)
        self._until = np.append(self._until, np.full(more, NEVER))
        self._scored = np.append(self._scored, np.zeros(more, dtype=bool))

    def thin(self, rows: IntArray) -> None:
        """Go on with the encounters at `rows` alone, in that order."""
        self._until, self._scored = self._until[rows], self._scored[rows]

    def reset(self, rows: IntArray, limit: IntArray) -> None:
        """Begin anew at `rows`, each to be scored until cycle `limit` at most."""
        self._until[rows] = np.minimum(limit, self._time_out)
        self._scored[rows] = False

    def over(self, age: IntArray, now: Observation) -> BoolArray:
        """Where an encounter has failed, its horizon has been seen, or its time is up; `age` is the cycle of `now`."""
        begins = (self._rules.begun(now) > self._scored).nonzero()[0]
        if len(begins):
            self._scored[begins] = True
            self._until[begins] = np.minimum(self._until[begins], age[begins] + self._horizon)
        return (age >= self._until) | (self._scored & (now.gap < -TOLERANCE))

"""Scoring: when an encounter is over; then failure, the bumpers' crossings, gaps, time to collision, braking, jerk."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from merge_cosim.controllers.law import FreeDriving
from merge_cosim.core.encounter import NEVER, Encounters, ReplayLog
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import DT, TOLERANCE, AnyArray, BoolArray, FloatArray, IntArray
from merge_cosim.scoring.decisions import decisions
from merge_cosim.scoring.human_difference import human_difference
from merge_cosim.scoring.tracks import Tracks

KINDS = ("", "side", "host_into_merging", "merging_into_host", "host_into_leader")
SIDE, HOST_INTO_MERGING, MERGING_INTO_HOST, HOST_INTO_LEADER = 1, 2, 3, 4
GOAL = 50.0
"""Station [m] at which the delay is taken."""
USUAL_ACCELERATION = 1.0
"""Acceleration [m/s^2] by which the length of a case is guessed."""

_Seconds = Annotated[float, Field(gt=0, le=3600)]  # every cycle until then has room in the memory


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
        """Where the cars stand so that scoring begins."""
        if self.overlap_from == "both":
            return np.minimum(now.host_station, now.merging_station) >= -TOLERANCE
        return now.merging_in_lane


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
    """Tells, cycle by cycle, which encounters of a batch are over: this alone must be known at once."""

    def __init__(self, count: int, rules: Rules) -> None:
        self._rules = rules
        self._horizon, self._time_out = rules.horizon_cycles, rules.time_out_cycles
        self._until = np.full(count, NEVER)
        self._scored = np.zeros(count, dtype=bool)

    def reset(self, rows: IntArray, limit: IntArray) -> None:
        """Begin anew at `rows`, each to be scored until cycle `limit` at most."""
        self._until[rows] = np.minimum(limit, self._time_out)
        self._scored[rows] = False

    def over(self, age: IntArray, now: Observation) -> BoolArray:
        """Where an encounter has failed, its horizon has been seen, or its time is up; `age` is the cycle of `now`."""
        begins = self._rules.begun(now) > self._scored
        if np.count_nonzero(begins):
            self._scored[begins] = True
            self._until[begins] = np.minimum(self._until[begins], age[begins] + self._horizon)
        return (age >= self._until) | (self._scored & (now.gap < -TOLERANCE))


def ends(tracks: Tracks, rules: Rules) -> IntArray:
    """The cycles in which encounters were over that were recorded beyond that, by the rules of `Watch`; shape (m,)."""
    start = tracks.reached(rules.begun(tracks.states) & (tracks.age > 0))
    scored = tracks.age >= start[tracks.encounter]
    failed = tracks.reached(scored & (tracks.states.gap < -TOLERANCE))
    longest = np.minimum(tracks.cycles, rules.time_out_cycles)
    return np.minimum(np.minimum(start + rules.horizon_cycles, failed), longest)


def score(tracks: Tracks, rules: Rules, log: ReplayLog | None = None) -> dict[str, AnyArray]:
    """All measures of some encounters that are over, and their last states; shape (m,) each, missing values NaN.

    Bodies are `[s - L, s]`; they overlap when they share more than the tolerance. Crossings (`host_reached_s`,
    `host_cleared_s`, `goal_s`, `merging_reached_s`, `merging_cleared_s`) are the times, interpolated, at which the
    front or (cleared) the rear bumper passes station 0, or the host's front `GOAL`.
    """
    states, last = tracks.states, tracks.last
    return {
        "end_cycle": tracks.cycles,
        "end_station": states.host_station[last],
        "end_speed": states.host_speed[last],
        "end_merging_station": states.merging_station[last],
        "end_merging_speed": states.merging_speed[last],
        **_gaps(tracks, rules),
        **_crossings(tracks),
        **_braking(tracks),
        **decisions(tracks),
        **human_difference(tracks, log),
    }


def _braking(tracks: Tracks) -> dict[str, FloatArray]:
    """Hardest braking [m/s^2], and the sum over the cycles, from the second one on, by how much it changed."""
    speed = tracks.states.host_speed
    braking, change = np.zeros_like(speed), np.zeros_like(speed)
    braking[1:] = (speed[:-1] - speed[1:]) / DT
    braking[tracks.first] = 0.0
    change[1:] = np.abs(braking[1:] - braking[:-1])
    change[tracks.first], change[tracks.first + 1] = 0.0, 0.0
    return {
        "hardest_braking": np.maximum.reduceat(braking, tracks.first),
        "jerk_sum": np.bincount(tracks.encounter, change),  # one after the other, so what else is scored changes no bit
    }


def _crossings(tracks: Tracks) -> dict[str, FloatArray]:
    """When bumpers pass the lines, and where the merging car is when the host arrives."""
    states = tracks.states
    host, merging = states.host_station, states.merging_station
    found = {name: tracks.fill(np.nan) for name in ("distance_m", "gap_m")}
    for name, station, line in (
        ("host_reached_s", host, 0.0),
        ("host_cleared_s", host, states.host_length),
        ("goal_s", host, GOAL),
        ("merging_reached_s", merging, 0.0),
        ("merging_cleared_s", merging, states.merging_length),
    ):
        edge = np.broadcast_to(line - TOLERANCE, station.shape)
        reached = tracks.reached(station >= edge)
        crossing = np.flatnonzero((reached > 0) & (reached <= tracks.cycles))
        after = tracks.first[crossing] + reached[crossing]
        before = after - 1
        part = (edge[after] + TOLERANCE - station[before]) / (station[after] - station[before])
        part = np.minimum(np.maximum(part, 0.0), 1.0)
        found[name] = tracks.fill(np.nan)
        found[name][crossing] = (reached[crossing] - 1 + part) * DT
        if name == "host_reached_s":
            other = merging[before] + part * (merging[after] - merging[before])
            leader_length = np.where(other >= -TOLERANCE, states.merging_length[after], states.host_length[after])
            found["distance_m"][crossing] = np.abs(other)
            found["gap_m"][crossing] = np.abs(other) - leader_length
    return found


def _gaps(tracks: Tracks, rules: Rules) -> dict[str, AnyArray]:
    """What is scored: from when on, the smallest gap and time to collision, the largest DRAC, and the failure."""
    states, encounter, age = tracks.states, tracks.encounter, tracks.age
    start = tracks.reached(rules.begun(states) & (age > 0))
    scored = np.flatnonzero(age >= start[encounter])
    gap, follows = states.gap[scored], states.merging_ahead[scored]
    closing = np.where(follows, 1.0, -1.0) * (states.host_speed - states.merging_speed)[scored]
    min_gap, min_ttc, max_drac = tracks.fill(np.inf), tracks.fill(np.inf), tracks.fill(0.0)
    np.minimum.at(min_gap, encounter[scored], gap)
    closer = closing > 0
    near, fast, whose = np.maximum(gap[closer], 0.0), closing[closer], encounter[scored[closer]]
    np.minimum.at(min_ttc, whose, near / fast)
    drac = np.divide(fast * fast, 2.0 * near, out=np.zeros_like(near), where=near > TOLERANCE)
    np.maximum.at(max_drac, whose, drac)
    later = np.where(states.merging_ahead[tracks.last], HOST_INTO_MERGING, MERGING_INTO_HOST)
    kind = np.where(tracks.cycles == start, SIDE, later)
    began = start <= tracks.cycles
    return {
        "kind": np.where(began & (states.gap[tracks.last] < -TOLERANCE), kind, 0),
        "scored_from": np.where(began, start, -1),
        "scored_to_end": tracks.cycles >= start + rules.horizon_cycles,
        "min_gap_m": min_gap,
        "min_ttc_s": min_ttc,
        "max_drac": max_drac,
    }

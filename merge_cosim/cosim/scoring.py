"""Scoring: what happened in each encounter, kept as arrays over the batch and updated once per cycle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from merge_cosim.cosim.decisions import DECISIONS, Decisions
from merge_cosim.cosim.likeness import LIKENESS, Likeness
from merge_cosim.encounter import ReplayLog
from merge_cosim.observation import Observation
from merge_cosim.units import DT, TOLERANCE, BoolArray, FloatArray, IntArray

KINDS = ("", "side", "host_into_merging", "merging_into_host", "host_into_leader")
SIDE, HOST_INTO_MERGING, MERGING_INTO_HOST, HOST_INTO_LEADER = 1, 2, 3, 4
GOAL = 50.0
"""Station [m] at which the delay is taken."""
CROSSINGS = ("host_reached_s", "host_cleared_s", "goal_s", "merging_reached_s", "merging_cleared_s")
"""Times, interpolated, at which the front or (cleared) the rear bumper passes station 0, or the host's front `GOAL`."""


@dataclass(frozen=True)
class Rules:
    """When an encounter is scored.

    Attributes:
        horizon: Time [s] scored from the first cycle on in which both cars have reached the merging point.
        time_out: Longest run [s].
        overlap_from: `both`: scored once both cars are past the merging point; `lane_change`: once the merging car is.
    """

    horizon: PositiveFloat = 3.0
    time_out: PositiveFloat = 40.0
    overlap_from: Literal["both", "lane_change"] = "both"


_SCORES = {
    "kind": 0.0,
    "scored_from": -1.0,
    "distance_m": np.nan,
    "gap_m": np.nan,
    "min_gap_m": np.inf,
    "min_ttc_s": np.inf,
    "max_drac": 0.0,
    "hardest_braking": 0.0,
    "jerk_sum": 0.0,
    "sumo_collision": 0.0,
    **dict.fromkeys(CROSSINGS, np.nan),
}
_EMPTY = _SCORES | DECISIONS | LIKENESS


class Scorer:
    """Scores a batch.

    Bodies are `[s - L, s]`; they overlap when they share more than the tolerance. Missing values are NaN. All measures
    lie in one block, so that encounters are begun and read off in one operation. Decisions are kept by `Decisions`, the
    difference to a logged host by `Likeness`.

    Attributes:
        block: All measures, shape (len(columns), count).
        columns: Each measure by name, shape (count,): a view of the block.
    """

    def __init__(self, count: int, rules: Rules, log: ReplayLog | None = None) -> None:
        self._rules = rules
        self._horizon = round(rules.horizon / DT)
        self._time_out = round(rules.time_out / DT)
        self._empty = np.array(list(_EMPTY.values()))[:, None]
        self.block = np.repeat(self._empty, count, axis=1)
        self.columns: dict[str, FloatArray] = dict(zip(_EMPTY, self.block, strict=True))
        own, decided = len(_SCORES), len(DECISIONS)
        self._times = self.block[own - len(CROSSINGS) : own]
        self._decisions = Decisions(self.block[own : own + decided])
        self._likeness = Likeness(self.block[own + decided :], log)
        self._lines, self._past = np.full_like(self._times, np.inf), np.zeros_like(self._times, dtype=bool)
        self._braking = np.zeros(count)
        self._begun: list[IntArray] = []

    def reset(self, rows: IntArray, cases: IntArray) -> None:
        """Begin the encounters `cases` anew at `rows`."""
        self.block[:, rows] = self._empty
        self._begun.append(rows)
        self._decisions.reset(rows)
        self._likeness.reset(rows, cases)

    def decided(self, age: IntArray, now: Observation, log_odds: FloatArray, not_yield: BoolArray) -> None:
        """Take in belief and decision of the present cycle; see `Decisions`."""
        self._decisions.decided(age, now, log_odds, not_yield)

    def moved(self, age: IntArray, before: Observation, now: Observation, colliding: BoolArray) -> BoolArray:
        """Take in one cycle's motion; `age` is the cycle of `now`. Returns where scoring or time is over."""
        if self._begun:
            self._begin(np.concatenate(self._begun), before, now)
        self._take_crossings(age, before, now)
        braking = (before.host_speed - now.host_speed) / DT
        self._likeness.moved(age, now)
        c = self.columns
        np.maximum(c["hardest_braking"], braking, out=c["hardest_braking"])
        c["jerk_sum"] += np.abs(braking - self._braking)
        self._braking = braking
        np.maximum(c["sumo_collision"], colliding, out=c["sumo_collision"])
        past = now.merging_station >= -TOLERANCE
        if self._rules.overlap_from == "both":
            past &= now.host_station >= -TOLERANCE
        np.copyto(c["scored_from"], age, where=(c["scored_from"] < 0) & past)
        self._take_gaps(age, now, c["scored_from"] >= 0)
        return (c["kind"] > 0) | self.scored_to_end(age) | (age >= self._time_out)

    def scored_to_end(self, age: IntArray) -> BoolArray:
        """Where the whole horizon has been seen."""
        start = self.columns["scored_from"]
        return (start >= 0) & (age >= start + self._horizon)

    def _begin(self, rows: IntArray, before: Observation, now: Observation) -> None:
        """Set up what needs the first two states of the encounters at `rows`."""
        self._begun.clear()
        nothing = np.zeros(len(rows))
        lines = (nothing, before.host_length[rows], nothing + GOAL, nothing, before.merging_length[rows])
        self._lines[:, rows] = np.array(lines) - TOLERANCE
        self._past[:3, rows] = before.host_station[rows] >= self._lines[:3, rows]
        self._past[3:, rows] = before.merging_station[rows] >= self._lines[3:, rows]
        self._braking[rows] = (before.host_speed[rows] - now.host_speed[rows]) / DT  # no jerk before the second cycle

    def _take_crossings(self, age: IntArray, before: Observation, now: Observation) -> None:
        self._past, past = np.empty_like(self._past), self._past
        np.greater_equal(now.host_station, self._lines[:3], out=self._past[:3])
        np.greater_equal(now.merging_station, self._lines[3:], out=self._past[3:])
        line, rows = np.nonzero(self._past > past)
        if not len(rows):
            return
        of_host = line < 3
        old = np.where(of_host, before.host_station[rows], before.merging_station[rows])
        new = np.where(of_host, now.host_station[rows], now.merging_station[rows])
        part = (self._lines[line, rows] + TOLERANCE - old) / (new - old)
        part = np.minimum(np.maximum(part, 0.0), 1.0)
        self._times[line, rows] = (age[rows] - 1 + part) * DT
        host = line == 0
        if host.any():
            rows, part = rows[host], part[host]
            start = before.merging_station[rows]
            other = start + part * (now.merging_station[rows] - start)
            leader_length = np.where(other >= -TOLERANCE, now.merging_length[rows], now.host_length[rows])
            self.columns["distance_m"][rows] = np.abs(other)
            self.columns["gap_m"][rows] = np.abs(other) - leader_length

    def _take_gaps(self, age: IntArray, now: Observation, scored: BoolArray) -> None:
        if not scored.any():
            return
        c = self.columns
        host_follows = now.merging_ahead
        lead = np.abs(now.merging_station - now.host_station)
        gap = lead - np.where(host_follows, now.merging_length, now.host_length)
        closing = np.where(host_follows, 1.0, -1.0) * (now.host_speed - now.merging_speed)
        np.copyto(c["min_gap_m"], np.minimum(c["min_gap_m"], gap), where=scored)
        rows = np.flatnonzero(scored & (closing > 0))
        if len(rows):
            near, fast = np.maximum(gap[rows], 0.0), closing[rows]
            c["min_ttc_s"][rows] = np.minimum(c["min_ttc_s"][rows], near / fast)
            drac = np.divide(fast * fast, 2.0 * near, out=np.zeros_like(near), where=near > TOLERANCE)
            c["max_drac"][rows] = np.maximum(c["max_drac"][rows], drac)
        rows = np.flatnonzero(scored & (gap < -TOLERANCE) & (c["kind"] == 0))
        if len(rows):
            later = np.where(host_follows[rows], HOST_INTO_MERGING, MERGING_INTO_HOST)
            c["kind"][rows] = np.where(age[rows] == c["scored_from"][rows], SIDE, later)

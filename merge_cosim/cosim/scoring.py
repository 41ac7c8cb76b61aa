"""Scoring: what happened in each encounter, kept as arrays over the batch and updated once per cycle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from merge_cosim.observation import Observation
from merge_cosim.units import DT, TOLERANCE, BoolArray, IntArray

KINDS = ("", "side", "host_into_merging", "merging_into_host")
SIDE, HOST_INTO_MERGING, MERGING_INTO_HOST = 1, 2, 3
GOAL = 50.0
"""Station [m] at which the delay is taken."""


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


class Scorer:
    """Scores a batch; `columns` maps each measure to its array, shape (count,).

    Bodies are `[s - L, s]`; they overlap when they share more than the tolerance. Missing values are NaN.
    """

    def __init__(self, count: int, rules: Rules) -> None:
        self._rules = rules
        self._horizon = round(rules.horizon / DT)
        self._time_out = round(rules.time_out / DT)
        self._empty: dict[str, float | int] = {
            "kind": 0,
            "scored_from": -1,
            "host_reached_s": np.nan,
            "merging_reached_s": np.nan,
            "goal_s": np.nan,
            "distance_m": np.nan,
            "gap_m": np.nan,
            "min_gap_m": np.inf,
            "min_ttc_s": np.inf,
            "hardest_braking": 0.0,
            "decision_flips": 0,
            "last_decision": -1,
            "sumo_collision": 0,
        }
        self.columns = {name: np.full(count, value) for name, value in self._empty.items()}

    def reset(self, rows: IntArray) -> None:
        """Begin anew at `rows`."""
        for name, value in self._empty.items():
            self.columns[name][rows] = value

    def decided(self, now: Observation, not_yield: BoolArray) -> None:
        """Take in the decision of the present cycle; it counts while neither car has reached the merging point."""
        c = self.columns
        still_open = np.maximum(now.host_station, now.merging_station) < -TOLERANCE
        changed = still_open & (c["last_decision"] >= 0) & (c["last_decision"] != not_yield)
        c["decision_flips"] += changed
        c["last_decision"] = np.where(still_open, not_yield, c["last_decision"])

    def moved(self, age: IntArray, before: Observation, now: Observation, colliding: BoolArray) -> BoolArray:
        """Take in one cycle's motion; `age` is the cycle of `now`. Returns where scoring or time is over."""
        self._take_crossings(age, before, now)
        c = self.columns
        c["hardest_braking"] = np.maximum(c["hardest_braking"], (before.host_speed - now.host_speed) / DT)
        c["sumo_collision"] |= colliding
        past = now.merging_station >= -TOLERANCE
        if self._rules.overlap_from == "both":
            past &= now.host_station >= -TOLERANCE
        c["scored_from"] = np.where((c["scored_from"] < 0) & past, age, c["scored_from"])
        self._take_gaps(age, now, c["scored_from"] >= 0)
        return (c["kind"] > 0) | self.scored_to_end(age) | (age >= self._time_out)

    def scored_to_end(self, age: IntArray) -> BoolArray:
        """Where the whole horizon has been seen."""
        start = self.columns["scored_from"]
        return (start >= 0) & (age >= start + self._horizon)

    def _take_crossings(self, age: IntArray, before: Observation, now: Observation) -> None:
        c = self.columns
        for name, old, new, line in (
            ("host_reached_s", before.host_station, now.host_station, 0.0),
            ("merging_reached_s", before.merging_station, now.merging_station, 0.0),
            ("goal_s", before.host_station, now.host_station, GOAL),
        ):
            rows = np.flatnonzero((old < line - TOLERANCE) & (new >= line - TOLERANCE))
            if not len(rows):
                continue
            part = np.minimum(np.maximum((line - old[rows]) / (new[rows] - old[rows]), 0.0), 1.0)
            c[name][rows] = (age[rows] - 1 + part) * DT
            if name == "host_reached_s":
                start = before.merging_station[rows]
                other = start + part * (now.merging_station[rows] - start)
                leader_length = np.where(other >= -TOLERANCE, now.merging_length[rows], now.host_length[rows])
                c["distance_m"][rows] = np.abs(other)
                c["gap_m"][rows] = np.abs(other) - leader_length

    def _take_gaps(self, age: IntArray, now: Observation, scored: BoolArray) -> None:
        if not scored.any():
            return
        c = self.columns
        host_follows = now.merging_ahead
        lead = np.abs(now.merging_station - now.host_station)
        gap = lead - np.where(host_follows, now.merging_length, now.host_length)
        closing = np.where(host_follows, 1.0, -1.0) * (now.host_speed - now.merging_speed)
        c["min_gap_m"] = np.where(scored, np.minimum(c["min_gap_m"], gap), c["min_gap_m"])
        ttc = np.divide(np.maximum(gap, 0.0), closing, out=np.full_like(gap, np.inf), where=scored & (closing > 0))
        c["min_ttc_s"] = np.minimum(c["min_ttc_s"], ttc)
        overlap = scored & (gap < -TOLERANCE) & (c["kind"] == 0)
        later = np.where(host_follows, HOST_INTO_MERGING, MERGING_INTO_HOST)
        c["kind"] = np.where(overlap, np.where(age == c["scored_from"], SIDE, later), c["kind"])

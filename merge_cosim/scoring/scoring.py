"""The measures of encounters: failure, the bumpers' crossings, gaps, time to collision, braking, jerk."""

from __future__ import annotations

import numpy as np

from merge_cosim.core.encounter import ReplayLog
from merge_cosim.core.units import DT, TOLERANCE, AnyArray, FloatArray
from merge_cosim.scoring.decisions import decisions
from merge_cosim.scoring.human_difference import human_difference
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.surroundings import surroundings
from merge_cosim.scoring.tracks import Tracks

KINDS = ("", "side", "host_into_merging", "merging_into_host", "host_into_leader")
SIDE, HOST_INTO_MERGING, MERGING_INTO_HOST, HOST_INTO_LEADER = 1, 2, 3, 4
GOAL = 50.0
"""Station [m] at which the delay is taken."""


def score(tracks: Tracks, rules: Rules, log: ReplayLog | None = None) -> dict[str, AnyArray]:
    """All measures of some encounters that are over, and their last states; shape (m,) each, missing values NaN.

    Bodies are `[s - L, s]`; they overlap when they share more than the tolerance. Crossings (`host_reached_s`,
    `host_cleared_s`, `goal_s`, `merging_reached_s`, `merging_cleared_s`) are the times, interpolated, at which the
    front or (cleared) the rear bumper passes station 0, or the host's front `GOAL`.
    """
    states, last = tracks.states, tracks.last
    measures = {
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
        **surroundings(tracks),
    }
    if "min_leader_gap_m" in measures:
        hit = (measures["kind"] == 0) & (measures["min_leader_gap_m"] < -TOLERANCE)
        measures["kind"] = np.where(hit, HOST_INTO_LEADER, measures["kind"])
    return measures


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
        "jerk_sum": np.bincount(
            tracks.encounter, change
        ),  # one after the other: the sum of an encounter does not depend on the others
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
    begun = rules.begun(tracks.states)
    begun[tracks.first] = False
    start = tracks.reached(begun)
    began = start <= tracks.cycles
    cycles = tracks.cycles[began] - start[began] + 1  # that are scored, of each
    after = np.cumsum(cycles)
    first = after - cycles
    scored = np.arange(after[-1] if len(after) else 0) + np.repeat((tracks.first + start)[began] - first, cycles)
    states, last = tracks.states.take(scored), tracks.states.take(tracks.last)
    gap = states.gap
    closing = np.where(states.merging_ahead, 1.0, -1.0) * (states.host_speed - states.merging_speed)
    closer, near = closing > 0, np.maximum(gap, 0.0)
    ttc = np.divide(near, closing, out=np.full_like(gap, np.inf), where=closer)
    drac = np.divide(closing * closing, 2.0 * near, out=np.zeros_like(gap), where=closer & (near > TOLERANCE))
    min_gap, min_ttc, max_drac = tracks.fill(np.inf), tracks.fill(np.inf), tracks.fill(0.0)
    if len(first):
        min_gap[began] = np.minimum.reduceat(gap, first)
        min_ttc[began] = np.minimum.reduceat(ttc, first)
        max_drac[began] = np.maximum.reduceat(drac, first)
    later = np.where(last.merging_ahead, HOST_INTO_MERGING, MERGING_INTO_HOST)
    kind = np.where(tracks.cycles == start, SIDE, later)
    return {
        "kind": np.where(began & (last.gap < -TOLERANCE), kind, 0),
        "scored_from": np.where(began, start, -1),
        "scored_to_end": tracks.cycles >= start + rules.horizon_cycles,
        "min_gap_m": min_gap,
        "min_ttc_s": min_ttc,
        "max_drac": max_drac,
    }

"""From tracks to encounters: which host-lane cars a merging car meets, and what of their logs is kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from merge_cosim.core.encounter import NEVER, Encounters, Intention, Ragged, ReplayLog
from merge_cosim.core.units import DT, TOLERANCE, AnyArray, FloatArray, IntArray
from merge_cosim.ngsim.pairing.rules import PairRules, cycles
from merge_cosim.ngsim.pairing.smoothing import filter_causally
from merge_cosim.ngsim.pairing.tracks import Tracks, build_tracks, carried_on
from merge_cosim.ngsim.sites import Site
from merge_cosim.ngsim.table import SIMULATED


@dataclass(frozen=True)
class Paired:
    """Encounters, and what the rules left out.

    Attributes:
        encounters: The pairs that passed.
        merging_cars: How many cars were seen to merge, paired or not.
        rejected: Reason -> names of the pairs (for `no_host`: keys of the merging cars). Reasons: `no_host` within
            reach, `short_window`, `host_changes_lane` within the window, `too_fast`, `too_hard` (acceleration),
            and `logged_host_fails` (see `checks`). The first that applies is given.
    """

    encounters: Encounters
    merging_cars: int
    rejected: Mapping[str, tuple[str, ...]]

    @staticmethod
    def concatenate(parts: Sequence[Paired]) -> Paired:
        """Join pairs of several sources."""
        reasons = dict.fromkeys(reason for part in parts for reason in part.rejected)
        return Paired(
            Encounters.concatenate([part.encounters for part in parts]),
            sum(part.merging_cars for part in parts),
            {reason: tuple(name for part in parts for name in part.rejected.get(reason, ())) for reason in reasons},
        )


def extract_pairs(table: pa.Table, site: Site, rules: PairRules, source: str) -> Paired:
    """Pair the merging cars of a canonical table, sorted as the reader does, with their hosts; see `pair_tracks`."""
    return pair_tracks(carried_on(build_tracks(table, site, rules), cycles(rules.carry_on)), site, rules, source)


def pair_tracks(tracks: Tracks, site: Site, rules: PairRules, source: str) -> Paired:
    """Pair each merging car with the nearest host-lane cars ahead and behind at its lane change.

    The window (cycle 0 on) starts as soon as both cars are logged, at the earliest with the merging car's first record,
    and reaches to the lane change. The logs go on to the end of each car's track, or to where it breaks the limits of
    speed and acceleration: what follows such a jump is a tracking error. Stations are smoothed positions less the
    merging car's at its lane change, so where the merging point lies differs from encounter to encounter. The initial
    speed of both cars is `(s_1 - s_0) / dt`, that of the first replayed step: the replay starts without a jump.
    """
    cars, change_rows = tracks.merges()
    change_frames = tracks.first_frame[cars] + change_rows - tracks.offsets[cars]
    merge, host = _nearest_hosts(tracks, cars, change_rows, rules.max_host_distance)
    merging, change = cars[merge], change_frames[merge]
    start = np.maximum(tracks.first_frame[merging], tracks.first_frame[host])
    if rules.max_window is not None:
        start = np.maximum(start, change - cycles(rules.max_window))

    host_start, host_change = tracks.row(host, start), tracks.row(host, change)
    merging_speed, merging_effort = _fastest_hardest(tracks.y, tracks.row(merging, start), change_rows[merge])
    host_speed, host_effort = _fastest_hardest(tracks.y, host_start, host_change)
    reason = np.select(
        [
            change - start < cycles(rules.min_window),
            tracks.leaves(host, host_start) <= host_change,
            np.maximum(merging_speed, host_speed) > rules.max_speed,
            np.maximum(merging_effort, host_effort) > rules.max_acceleration,
        ],
        ["short_window", "host_changes_lane", "too_fast", "too_hard"],
        default="",
    )
    rejected = {"no_host": tuple(np.delete(_keys(tracks, site, cars), merge))}
    names = _names(tracks, merging, host)
    rejected |= {str(why): tuple(names[reason == why]) for why in np.unique(reason[reason != ""])}
    kept = reason == ""
    encounters = _encounters(tracks, merging[kept], host[kept], start[kept], change[kept], site, rules, source)
    return Paired(encounters, len(cars), {why: who for why, who in rejected.items() if who})


def _nearest_hosts(tracks: Tracks, cars: IntArray, change_rows: IntArray, reach: float) -> tuple[IntArray, IntArray]:
    """Find up to two hosts for each merging car; return which of `cars` each pair belongs to, and the host's track."""
    pairs: list[tuple[int, int]] = []
    _, recording = np.unique(tracks.recording, return_inverse=True)
    last_frame = tracks.last_frame
    for index, (car, row) in enumerate(zip(cars, change_rows, strict=True)):
        frame = tracks.first_frame[car] + row - tracks.offsets[car]
        there = (recording == recording[car]) & (tracks.first_frame <= frame) & (frame <= last_frame)
        there[car] = False
        others = np.flatnonzero(there)
        rows = tracks.row(others, frame)
        others, rows = others[tracks.in_host[rows]], rows[tracks.in_host[rows]]
        lead = tracks.y[rows] - tracks.y[row]
        for ahead in (False, True):
            near = np.flatnonzero((np.abs(lead) <= reach + TOLERANCE) & ((lead >= -TOLERANCE) == ahead))
            if len(near):
                pairs.append((index, int(others[near[np.argmin(np.abs(lead[near]))]])))
    found = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _fastest_hardest(y: FloatArray, first: IntArray, last: IntArray) -> tuple[FloatArray, FloatArray]:
    """Largest speed [m/s] and absolute acceleration [m/s^2] of the stretches of rows `first` to `last`."""
    speeds = [np.diff(y[a : b + 1]) / DT for a, b in zip(first, last, strict=True)]
    fastest = [speed.max(initial=0.0) for speed in speeds]
    hardest = [np.abs(np.diff(speed) / DT).max(initial=0.0) for speed in speeds]
    return np.array(fastest), np.array(hardest)


def _names(tracks: Tracks, merging: IntArray, host: IntArray) -> AnyArray:
    """Case names, such as `us101_A-42.1-h17.1`: recording, merging car and part, host and part."""
    rec, car, part = tracks.recording, tracks.vehicle, tracks.part
    pairs = zip(merging, host, strict=True)
    return np.array([f"{rec[m]}-{car[m]}.{part[m]}-h{car[h]}.{part[h]}" for m, h in pairs], dtype=object)


def _keys(tracks: Tracks, site: Site, cars: IntArray) -> AnyArray:
    """Car keys, such as `us101/us101_A/42/1`."""
    keys = [f"{site.name}/{tracks.recording[t]}/{tracks.vehicle[t]}/{tracks.part[t]}" for t in cars]
    return np.array(keys, dtype=object)


def _source(recording: str, source: str) -> str:
    """The surrogate's recordings are called so whatever folder they lie in."""
    return "surrogate" if recording.startswith(SIMULATED) else source


def _encounters(
    tracks: Tracks,
    merging: IntArray,
    host: IntArray,
    start: IntArray,
    change: IntArray,
    site: Site,
    rules: PairRules,
    source: str,
) -> Encounters:
    """Cut the logs of the pairs that passed; `start` and `change` are frames."""
    m_start, h_start = tracks.row(merging, start), tracks.row(host, start)
    m_change, h_change = tracks.row(merging, change), tracks.row(host, change)
    m_end, h_end = _credible_end(tracks, merging, m_change, rules), _credible_end(tracks, host, h_change, rules)
    m_leaves, h_leaves = tracks.leaves(merging, m_change), tracks.leaves(host, h_change)
    origin = tracks.y[m_change]
    length = np.where(tracks.length > 0, tracks.length, rules.default_length)
    missing = ~(tracks.length > 0)
    smoothed = [
        tracks.smoothed[a : b + 1].any() or tracks.smoothed[c : d + 1].any()
        for a, b, c, d in zip(m_start, m_change, h_start, h_change, strict=True)
    ]
    return Encounters(
        case=_names(tracks, merging, host),
        site=np.full(len(merging), site.name, dtype=object),
        source=np.array([_source(tracks.recording[t], source) for t in merging], dtype=object),
        car=_keys(tracks, site, merging),
        host_station=tracks.y[h_start] - origin,
        host_speed=(tracks.y[h_start + 1] - tracks.y[h_start]) / DT,
        host_length=length[host],
        merging_station=tracks.y[m_start] - origin,
        merging_speed=(tracks.y[m_start + 1] - tracks.y[m_start]) / DT,
        merging_length=length[merging],
        merge_position=origin - site.gore_y,
        label=np.where(tracks.y[h_change] - origin >= -TOLERANCE, Intention.YIELD, Intention.NOT_YIELD),
        smoothed_source=np.array(smoothed, dtype=bool),
        length_missing=missing[host] | missing[merging],
        log=ReplayLog(
            merging_station=Ragged.of([tracks.y[a:b] - o for a, b, o in zip(m_start, m_end, origin, strict=True)]),
            merging_speed=Ragged.of(
                [_observed(tracks, t, a, b, rules) for t, a, b in zip(merging, m_start, m_end, strict=True)]
            ),
            host_station=Ragged.of([tracks.y[a:b] - o for a, b, o in zip(h_start, h_end, origin, strict=True)]),
            change_cycle=change - start,
            score_until=np.minimum(
                np.where(m_leaves < tracks.offsets[merging + 1], m_leaves - m_start - 1, NEVER),
                np.where(h_leaves < tracks.offsets[host + 1], h_leaves - h_start - 1, NEVER),
            ),
            host_speed=Ragged.of(
                [_observed(tracks, t, a, b, rules) for t, a, b in zip(host, h_start, h_end, strict=True)]
            ),
        ),
    )


def _credible_end(tracks: Tracks, track: IntArray, change: IntArray, rules: PairRules) -> IntArray:
    """Row after the last credible one of each track: where it breaks the limits after row `change`, or its end.

    A track that ended before `change` was carried on as far as that row.
    """
    ends = np.maximum(tracks.offsets[track + 1] - tracks.carried, change + 1)
    for index, (first, end) in enumerate(zip(change - 1, ends, strict=True)):
        speed = np.diff(tracks.y[first:end]) / DT
        jumps = (speed[1:] > rules.max_speed) | (np.abs(np.diff(speed) / DT) > rules.max_acceleration)
        if jumps.any():
            ends[index] = first + 2 + np.argmax(jumps)
    return ends


def _observed(tracks: Tracks, track: int, start: int, end: int, rules: PairRules) -> FloatArray:
    """Speed [m/s] of a car as observed in rows `start` to `end`; the filter uses earlier rows as well."""
    first = tracks.offsets[track]
    speed = tracks.speed[first:end]
    if rules.observed == "causal":
        speed = filter_causally(speed, rules.observed_window, rules.observed_order)
    return speed[start - first :]

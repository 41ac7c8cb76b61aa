"""Meetings scored as the encounters of the pair tests are, once it is known where each merging car merged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from merge_cosim.cosim.loop import Effort, Run
from merge_cosim.cosim.scenes.meetings import RECORDED, Ending, Meeting
from merge_cosim.cosim.scoring import HOST_INTO_LEADER, Rules, Scorer
from merge_cosim.encounter import Encounters, Intention
from merge_cosim.observation import Observation
from merge_cosim.units import TOLERANCE, AnyArray, FloatArray

LEAST_STATES = 2
"""A meeting that is to be scored has been seen to move."""


def to_be_scored(meetings: Sequence[Meeting]) -> list[Meeting]:
    """Those in which the merging car came to drive next to the host."""
    wanted = (Ending.SCORED, Ending.CENSORED)
    return [meeting for meeting in meetings if meeting.ending in wanted and len(meeting.states) >= LEAST_STATES]


def encounters_of(meetings: Sequence[Meeting], scene: str, site: str, source: str) -> Encounters:
    """The initial states of meetings, with the place of the lane change as the merging point.

    Args:
        meetings: Those `to_be_scored`.
        scene: Name of the scene, which begins the name of each case.
        site: Name of the ramp.
        source: Where the cars come from.
    """
    n = len(meetings)
    first = np.array([meeting.states[0][:4] for meeting in meetings]).reshape(n, 4)
    merge_position = np.array([meeting.merge_position for meeting in meetings])
    nothing = np.zeros(n, dtype=bool)
    return Encounters(
        case=np.array([f"{scene}/{meeting.host.name}/{meeting.merging.name}" for meeting in meetings], dtype=str),
        site=np.full(n, site),
        source=np.full(n, source),
        car=np.full(n, ""),
        host_station=first[:, 0] - merge_position,
        host_speed=first[:, 1],
        host_length=np.array([meeting.host.length for meeting in meetings]),
        merging_station=first[:, 2] - merge_position,
        merging_speed=first[:, 3],
        merging_length=np.array([meeting.merging.length for meeting in meetings]),
        merge_position=merge_position,
        label=np.full(n, int(Intention.UNKNOWN)),
        smoothed_source=nothing,
        length_missing=nothing,
    )


def score(meetings: Sequence[Meeting], encounters: Encounters, rules: Rules) -> tuple[Run, dict[str, FloatArray]]:
    """Score meetings by the scorer of the pair tests.

    Returns:
        The run, and `min_leader_gap_m`, `min_leader_ttc_s`, `min_follower_gap_m` (inf without such a car), shape (n,).
    """
    n = len(meetings)
    last = np.array([len(meeting.states) - 1 for meeting in meetings], dtype=np.int64)
    states = np.zeros((int(last.max(initial=0)) + 1, len(RECORDED), n))
    for row, meeting in enumerate(meetings):
        states[: last[row] + 1, :, row] = meeting.states
        states[last[row] + 1 :, :, row] = meeting.states[-1]
    scorer = Scorer(n, rules)
    scorer.reset(np.arange(n), np.arange(n))
    columns: dict[str, AnyArray] = {name: np.zeros(n) for name in scorer.columns}
    columns |= {"end_cycle": last.copy(), "scored_to_end": np.zeros(n, dtype=bool)}
    running = np.ones(n, dtype=bool)
    for cycle in range(len(states) - 1):
        now, after = (_observation(states[one], encounters) for one in (cycle, cycle + 1))
        age = np.full(n, cycle)
        scorer.decided(age, now, _of(states[cycle], "log_odds"), _of(states[cycle], "not_yield") > 0)
        over = scorer.moved(age + 1, now, after, _of(states[cycle + 1], "contact") > 0)
        ends = np.flatnonzero(running & (over | (cycle + 1 == last)))
        for name, values in scorer.columns.items():
            columns[name][ends] = values[ends]
        columns["end_cycle"][ends] = cycle + 1
        columns["scored_to_end"][ends] = scorer.scored_to_end(age + 1)[ends]
        running[ends] = False
    at_end = states[columns["end_cycle"], :, np.arange(n)].T.reshape(len(RECORDED), n)
    ends_with = ("end_station", "end_speed", "end_merging_station", "end_merging_speed")
    for name, value in zip(ends_with, at_end[:4], strict=True):
        columns[name] = value - encounters.merge_position if name.endswith("station") else value
    others = _others(states, columns["end_cycle"])
    hit = (columns["kind"] == 0) & (others["min_leader_gap_m"] < -TOLERANCE)
    columns["kind"][hit] = HOST_INTO_LEADER
    return Run(columns, Effort()), others


def _of(state: FloatArray, name: str) -> FloatArray:
    return state[RECORDED.index(name)]


def _observation(state: FloatArray, encounters: Encounters) -> Observation:
    host_x, host_speed, merging_x, merging_speed = state[:4]
    merge_position = encounters.merge_position
    return Observation(
        host_x - merge_position,
        host_speed,
        merging_x - merge_position,
        merging_speed,
        encounters.host_length,
        encounters.merging_length,
    )


def _others(states: FloatArray, end: AnyArray) -> dict[str, FloatArray]:
    """Smallest gaps to the cars ahead and behind in the host lane, and the time to collision with the one ahead."""
    counted = np.arange(len(states))[:, None] <= end
    leader, follower = states[:, RECORDED.index("leader_gap")], states[:, RECORDED.index("follower_gap")]
    closing = states[:, RECORDED.index("host_speed")] - states[:, RECORDED.index("leader_speed")]
    near = counted & np.isfinite(leader) & (closing > 0)
    time = np.divide(np.maximum(leader, 0.0), closing, out=np.full_like(leader, np.inf), where=near)
    return {
        "min_leader_gap_m": np.where(counted, leader, np.inf).min(axis=0),
        "min_leader_ttc_s": time.min(axis=0),
        "min_follower_gap_m": np.where(counted, follower, np.inf).min(axis=0),
    }

"""Meetings scored as the encounters of the pair tests are, once it is known where each merging car merged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.units import TOLERANCE, FloatArray
from merge_cosim.scoring.scoring import HOST_INTO_LEADER, Rules, ends
from merge_cosim.scoring.scoring import score as score_tracks
from merge_cosim.scoring.tracks import Tracks
from merge_cosim.simulation.loop import Effort, Run
from merge_cosim.simulation.worlds.meetings import RECORDED, Ending, Meeting

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
    first = np.array([meeting.states[0][:4] for meeting in meetings]).reshape(-1, 4)
    merge_position = np.array([meeting.merge_position for meeting in meetings])
    return Encounters.unlogged(
        np.array([f"{scene}/{meeting.host.name}/{meeting.merging.name}" for meeting in meetings], dtype=str),
        site,
        source,
        host_station=first[:, 0] - merge_position,
        host_speed=first[:, 1],
        host_length=np.array([meeting.host.length for meeting in meetings]),
        merging_station=first[:, 2] - merge_position,
        merging_speed=first[:, 3],
        merging_length=np.array([meeting.merging.length for meeting in meetings]),
        merge_position=merge_position,
    )


def score(meetings: Sequence[Meeting], encounters: Encounters, rules: Rules) -> tuple[Run, dict[str, FloatArray]]:
    """Score meetings by the rules and measures of the pair tests.

    Returns:
        The run, and `min_leader_gap_m`, `min_leader_ttc_s`, `min_follower_gap_m` (inf without such a car), shape (n,).
    """
    recorded = [np.array(meeting.states).T for meeting in meetings]
    tracks = _tracks(recorded, encounters)
    cycles = ends(tracks, rules)
    recorded = [states[:, : end + 1] for states, end in zip(recorded, cycles.tolist(), strict=True)]
    columns = score_tracks(tracks.until(cycles), rules)
    columns["sumo_collision"] = np.array([_of(states, "contact")[1:].max() for states in recorded], dtype=bool)
    others = {
        "min_leader_gap_m": np.array([_of(states, "leader_gap").min() for states in recorded], dtype=float),
        "min_leader_ttc_s": np.array([_leader_ttc(states) for states in recorded], dtype=float),
        "min_follower_gap_m": np.array([_of(states, "follower_gap").min() for states in recorded], dtype=float),
    }
    hit = (columns["kind"] == 0) & (others["min_leader_gap_m"] < -TOLERANCE)
    columns["kind"][hit] = HOST_INTO_LEADER
    return Run(columns, Effort()), others


def _tracks(recorded: Sequence[FloatArray], encounters: Encounters) -> Tracks:
    """The meetings with their stations, which are known only now that their merging points are."""
    tracks = []
    for states, merge_position in zip(recorded, encounters.merge_position, strict=True):
        host, merging = _of(states, "host_x") - merge_position, _of(states, "merging_x") - merge_position
        speeds = _of(states, "host_speed"), _of(states, "merging_speed")
        tracks.append(np.array([host, merging, *speeds, _of(states, "log_odds")]))
    return Tracks.of(encounters, range(len(tracks)), tracks)


def _of(states: FloatArray, name: str) -> FloatArray:
    return states[RECORDED.index(name)]


def _leader_ttc(states: FloatArray) -> float:
    """Smallest time to collision with the car ahead in the host lane [s]; inf if the host never closed in on one."""
    leader, closing = _of(states, "leader_gap"), _of(states, "host_speed") - _of(states, "leader_speed")
    near = np.isfinite(leader) & (closing > 0)
    return float(np.min(np.maximum(leader[near], 0.0) / closing[near], initial=np.inf))

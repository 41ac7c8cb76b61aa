"""Gaps between a host and its leader and follower in the lane."""

from __future__ import annotations

import numpy as np

from merge_cosim.core.units import FloatArray
from merge_cosim.scoring.tracks import Tracks

LEADER_GAP, LEADER_CLOSING, FOLLOWER_GAP = "leader_gap_m", "leader_closing_m_s", "follower_gap_m"
AROUND = (LEADER_GAP, LEADER_CLOSING, FOLLOWER_GAP)
"""What worlds with other cars record of each cycle: gap to the car ahead of the host in its lane and speed at which the
host closes in on it, gap to the car behind; bumper to bumper, gaps inf without such a car [m, m/s, m]."""
MEASURES = ("min_leader_gap_m", "min_leader_ttc_s", "min_follower_gap_m")


def surroundings(tracks: Tracks) -> dict[str, FloatArray]:
    """Smallest gaps to leader and follower [m], smallest time to collision with the leader [s]; shape (m,) each.

    Inf without such a car, or where the host never closed in on it. Empty for tracks of two cars without others.
    """
    if LEADER_GAP not in tracks.around:
        return {}
    gap, closing = tracks.around[LEADER_GAP], tracks.around[LEADER_CLOSING]
    nearing = np.isfinite(gap) & (closing > 0)
    time = np.full(len(gap), np.inf)
    time[nearing] = np.maximum(gap[nearing], 0.0) / closing[nearing]
    smallest = (gap, time, tracks.around[FOLLOWER_GAP])
    return {
        name: np.minimum.reduceat(values, tracks.first) if len(values) else values
        for name, values in zip(MEASURES, smallest, strict=True)
    }

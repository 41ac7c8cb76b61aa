"""The papers' figures that no single sweep has: number of speed nodes, and which cars are on camera when."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from merge_cosim.core import colors
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT, IntArray
from merge_cosim.ngsim.data import load_trajectories
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.tracks import Tracks, build_tracks
from merge_cosim.ngsim.sites import Site
from merge_cosim.report import canvas
from merge_cosim.report.methods import Look
from merge_cosim.studies.papers.evidence import Evidence

ROLES = {"leading car": colors.GREEN, "host": colors.HOST, "merging car": colors.MERGING}
MOST_MERGING = 6
"""Merging cars drawn at most."""


def node_figure(evidence: Evidence, looks: Mapping[str, Look]) -> Figure:
    """Failure rate of PGM by its number of speed nodes (Dong, Dolan, Litkouhi 2017, number of speed nodes)."""
    rows = evidence.nodes
    with canvas.style():
        figure, axes = canvas.panel()
        for method, part in rows.groupby("method"):
            look = looks[str(method)]
            rate = part["failure_pct"].to_numpy(dtype=float)
            low, high = (part[name].to_numpy(dtype=float) for name in ("ci_low_pct", "ci_high_pct"))
            axes.plot(part["nodes"], rate, look.line, marker=look.mark, ms=3.5, color=look.color, label=method)
            axes.fill_between(part["nodes"], low, high, color=look.color, alpha=0.12, lw=0)
        axes.set(xlabel="speed nodes n", ylabel="failures [%]", ylim=(0.0, None))
        axes.legend()
    return figure


def overlap_figure(data: Path, site: Site) -> Figure:
    """When a host, the car ahead of it and the merging cars near it are on camera (Lyu, Dong, Dolan 2020, Fig. 4).

    The host is the one that the most merging cars change lane beside.

    Raises:
        UserError: The folder has no merging car of the site.
    """
    table = load_trajectories(data, site)
    tracks = None if table is None else build_tracks(table, site, PairRules())
    if tracks is None or not len(tracks.merges()[0]):
        raise UserError(f"{data}: no merging car of {site.name} in it")
    host, merging = _busiest_host(tracks)
    leader = _leader(tracks, host, merging)
    cars = [*([("leading car", leader)] if leader is not None else []), ("host", host)]
    cars += [("merging car", int(track)) for track in merging[:MOST_MERGING]]
    origin = tracks.first_frame[[track for _, track in cars]].min()
    with canvas.style():
        figure, axes = canvas.panel(height=0.7 + 0.32 * len(cars))
        for row, (role, track) in enumerate(cars):
            begin, end = ((tracks.first_frame[track] - origin) * DT, (tracks.last_frame[track] - origin + 1) * DT)
            axes.barh(row, end - begin, left=begin, height=0.6, color=ROLES[role])
        axes.set_yticks(range(len(cars)), [f"{role} {tracks.vehicle[track]}" for role, track in cars])
        axes.invert_yaxis()
        axes.grid(axis="y", visible=False)
        axes.set(xlabel="time [s]")
    return figure


def _busiest_host(tracks: Tracks) -> tuple[int, IntArray]:
    """The host-lane track during which the most cars merge within a pair's reach, and those cars by time of merging."""
    cars, rows = tracks.merges()
    frames = tracks.first_frame[cars] + rows - tracks.offsets[cars]
    best, found = -1, np.empty(0, dtype=np.int64)
    for host in range(len(tracks)):
        there = tracks.recording[cars] == tracks.recording[host]
        there &= (cars != host) & (tracks.first_frame[host] <= frames) & (frames <= tracks.last_frame[host])
        near = np.flatnonzero(there)
        at = tracks.row(np.full(len(near), host), frames[near])
        near = near[tracks.in_host[at] & (np.abs(tracks.y[at] - tracks.y[rows[near]]) <= PairRules().max_host_distance)]
        if len(near) > len(found):
            best, found = host, cars[near[np.argsort(frames[near])]]
    return best, found


def _leader(tracks: Tracks, host: int, merging: IntArray) -> int | None:
    """The car ahead of a host in the middle of its track that is none of the merging cars."""
    frame = (tracks.first_frame[host] + tracks.last_frame[host]) // 2
    there = (tracks.recording == tracks.recording[host]) & (tracks.first_frame <= frame) & (frame <= tracks.last_frame)
    there[[host, *merging.tolist()]] = False
    others = np.flatnonzero(there)
    rows = tracks.row(others, np.full(len(others), frame))
    lead = tracks.y[rows] - tracks.y[tracks.row(np.array([host]), np.array([frame]))[0]]
    ahead = np.flatnonzero(tracks.in_host[rows] & (lead > 0))
    return int(others[ahead[np.argmin(lead[ahead])]]) if len(ahead) else None

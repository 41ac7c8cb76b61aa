"""Gap-free tracks of the cars near the merge, laid end to end, and where they are in the host lane."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from merge_cosim.core.units import DT, AnyArray, BoolArray, FloatArray, IntArray
from merge_cosim.ngsim.pairing.rules import PairRules, cycles
from merge_cosim.ngsim.pairing.smoothing import smooth_tracks
from merge_cosim.ngsim.sites import Site


@dataclass(frozen=True)
class Tracks:
    """Tracks at 10 Hz without a gap; row `offsets[i] + k` is track `i` at frame `first_frame[i] + k`.

    Attributes:
        recording, vehicle, part: Key of each track, shape (n,).
        first_frame: Its first frame, on its recording's clock, shape (n,).
        length: Its car's length [m], NaN where none was logged, shape (n,).
        offsets: Where each track starts in the rows, shape (n + 1,).
        y: Smoothed position of the front bumper along the road [m], shape (rows,).
        speed: Logged speed [m/s], shape (rows,).
        on_ramp: In an on-ramp lane, shape (rows,).
        in_host: In the host lane, flicker removed, shape (rows,).
        lane: The recording's lane number, flicker removed, shape (rows,). The lanes beside the main road (on-ramp,
            auxiliary lane, off-ramp) are one path and all have the number of the site's first on-ramp lane.
        smoothed: Smoothed by the source before it was published, shape (rows,).
        carried: So many rows at the end of every track were not logged: the car goes on at its last speed, in its lane.
    """

    recording: AnyArray
    vehicle: IntArray
    part: IntArray
    first_frame: IntArray
    length: FloatArray
    offsets: IntArray
    y: FloatArray
    speed: FloatArray
    on_ramp: BoolArray
    in_host: BoolArray
    lane: IntArray
    smoothed: BoolArray
    carried: int = 0

    def __len__(self) -> int:
        return len(self.vehicle)

    @property
    def last_frame(self) -> IntArray:
        """Last frame of each track, those carried on included, shape (n,)."""
        return self.first_frame + np.diff(self.offsets) - 1

    def row(self, track: IntArray, frame: IntArray) -> IntArray:
        """Rows of `track` at `frame`, which must lie within it."""
        return self.offsets[track] + frame - self.first_frame[track]

    def leaves(self, track: IntArray, row: IntArray) -> IntArray:
        """First row at or after `row` out of the host lane, or the end of the track if there is none."""
        out = np.append(np.flatnonzero(~self.in_host), len(self.in_host))
        return np.minimum(out[np.searchsorted(out, row)], self.offsets[track + 1])

    def merges(self) -> tuple[IntArray, IntArray]:
        """Tracks that come from the ramp and change into the host lane, and the row of that change."""
        starts = self.offsets[:-1]
        change = np.flatnonzero(self.in_host[1:] & ~self.in_host[:-1] & self.on_ramp[:-1]) + 1
        track = np.searchsorted(starts, change, side="right") - 1
        inside = (change != starts[track]) & self.on_ramp[starts[track]] & ~self.in_host[starts[track]]
        track, first = np.unique(track[inside], return_index=True)
        return track, change[inside][first]


def build_tracks(table: pa.Table, site: Site, rules: PairRules, *, everywhere: bool = False) -> Tracks:
    """Take the tracks that touch an on-ramp lane or the host lane, or all, out of a canonical trajectory table.

    A track ends where its key changes and at every gap between frames, so nothing is smoothed or paired across one.

    Args:
        table: Trajectories of one site, sorted by recording, vehicle, part and frame.
        site: Its lanes.
        rules: Filter and flicker time.
        everywhere: Also take the tracks that touch neither lane.
    """
    lane = table["lane"].to_numpy()
    frame = table["frame"].to_numpy()
    recording = table["recording"].unify_dictionaries().combine_chunks()
    codes = recording.indices.to_numpy()
    vehicle, part = table["vehicle_id"].to_numpy(), table["part"].to_numpy()
    starts_here = np.ones(len(lane), dtype=bool)
    starts_here[1:] = np.diff(frame) != 1
    for key in (codes, vehicle, part):
        starts_here[1:] |= key[1:] != key[:-1]
    starts = np.flatnonzero(starts_here)
    near = np.isin(lane, (*site.ramp_lanes, *site.lanes.host))
    lengths = np.diff(np.append(starts, len(lane)))
    wanted = np.logical_or.reduceat(near | everywhere, starts) if len(starts) else np.empty(0, dtype=bool)
    rows = np.flatnonzero(np.repeat(wanted, lengths))
    starts, lengths = starts[wanted], lengths[wanted]
    offsets = np.append(0, np.cumsum(lengths)).astype(np.int64)
    lane = _lanes_by_path(lane[rows], offsets[:-1], site)
    path = np.where(np.isin(lane, site.side_lanes), site.ramp_lanes[0], lane).astype(np.int64)
    return Tracks(
        recording=np.asarray(recording.dictionary.to_pylist(), dtype=object)[codes[starts]],
        vehicle=vehicle[starts].astype(np.int64),
        part=part[starts].astype(np.int64),
        first_frame=frame[starts].astype(np.int64),
        length=np.asarray(table["length"].to_numpy()[starts], dtype=np.float64),
        offsets=offsets,
        y=smooth_tracks(table["y"].to_numpy()[rows], offsets, rules.smoothing_window, rules.smoothing_order),
        speed=np.asarray(table["speed"].to_numpy()[rows], dtype=np.float64),
        on_ramp=np.isin(lane, site.ramp_lanes),
        in_host=without_flicker(lane == site.host_lane, offsets, cycles(rules.hold)),
        lane=steady_lanes(path, offsets, cycles(rules.hold)),
        smoothed=table["smoothed"].to_numpy()[rows],
    )


def carried_on(tracks: Tracks, more: int) -> Tracks:
    """Carry every track on by `more` rows: its last step is repeated, all else stays as in its last row."""
    if not more:
        return tracks
    ends, steps = tracks.offsets[1:], np.diff(tracks.offsets)
    last = ends - 1
    step = np.where(steps > 1, tracks.y[last] - tracks.y[last - 1], tracks.speed[last] * DT)
    rows = np.insert(np.arange(len(tracks.y)), np.repeat(ends, more), np.repeat(last, more))
    beyond = np.insert(np.zeros(len(tracks.y)), np.repeat(ends, more), np.tile(np.arange(1, more + 1), len(tracks)))
    track = np.repeat(np.arange(len(tracks)), steps + more)
    held = {name: getattr(tracks, name)[rows] for name in ("speed", "on_ramp", "in_host", "lane", "smoothed")}
    return replace(
        tracks,
        **held,
        offsets=tracks.offsets + more * np.arange(len(tracks) + 1),
        y=tracks.y[rows] + beyond * step[track],
        carried=more,
    )


def _lanes_by_path(lane: AnyArray, starts: IntArray, site: Site) -> AnyArray:
    """Give the host lane one number, and a car in a shared lane the lane that it had before (at first the host lane).

    Args:
        lane: Lane numbers as logged, tracks end to end, shape (rows,).
        starts: First row of each track.
        site: What the numbers mean.
    """
    lane = np.where(np.isin(lane, site.lanes.host), site.host_lane, lane)
    shared = np.isin(lane, site.lanes.shared)
    lane[starts[shared[starts]]] = site.host_lane
    shared[starts] = False
    return lane[np.maximum.accumulate(np.where(shared, 0, np.arange(len(lane))))]


def without_flicker(in_lane: BoolArray, offsets: IntArray, hold: int) -> BoolArray:
    """Ignore changes of lane that do not last.

    A run of equal values counts if it lasts `hold` cycles, if its track begins with it, or if it is a departure that
    lasts to the end of its track (flicker comes back). A shorter run takes the value of the last one that counts.

    Args:
        in_lane: In the lane as logged, tracks end to end, shape (rows,).
        offsets: Where each track starts, shape (n + 1,).
        hold: Shortest run that counts [cycles].
    """
    run, end = _runs(in_lane, offsets)
    departed = ~in_lane[run] & np.isin(end, offsets)
    return _last_that_counts(in_lane, run, end, (end - run >= hold) | np.isin(run, offsets) | departed)


def steady_lanes(lane: IntArray, offsets: IntArray, hold: int) -> IntArray:
    """Ignore changes of lane that do not last, whichever the lanes; a merge is where `without_flicker` has it.

    A run of equal lanes counts if it lasts `hold` cycles or if its track begins with it. A shorter run takes the lane
    of the last one that counts, at the end of a track, too: whether the car would have stayed is not known.

    Args:
        lane: Lane numbers as logged, tracks end to end, shape (rows,).
        offsets: Where each track starts, shape (n + 1,).
        hold: Shortest run that counts [cycles].
    """
    run, end = _runs(lane, offsets)
    return _last_that_counts(lane, run, end, (end - run >= hold) | np.isin(run, offsets))


def _runs(values: AnyArray, offsets: IntArray) -> tuple[IntArray, IntArray]:
    """Rows where runs of equal values start, and the rows after their last ones; no run passes from track to track."""
    begins = np.zeros(len(values), dtype=bool)
    begins[1:] = values[1:] != values[:-1]
    begins[offsets[:-1]] = True
    run = np.flatnonzero(begins)
    return run, np.append(run[1:], len(values))[: len(run)]


def _last_that_counts(values: AnyArray, run: IntArray, end: IntArray, counts: BoolArray) -> AnyArray:
    """Give each run the value of the last one up to it that counts."""
    source = np.maximum.accumulate(np.where(counts, np.arange(len(run)), 0))
    return np.repeat(values[run][source], end - run)

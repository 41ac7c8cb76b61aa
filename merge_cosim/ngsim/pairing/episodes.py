"""NGSIM's merging episodes, 68 of them published for US-101: short real merges that end at the lane change.

Each starts with the merging car (car 0) in the auxiliary lane; the other cars, tracked by continuity, are in the host
lane as long as they are there. Positions are in metres from the gore, times in cycles; there are no lengths, no clock
and nothing after the lane change.
"""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray
from merge_cosim.ngsim.pairing.pairs import Paired, pair_tracks
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.smoothing import smooth_tracks
from merge_cosim.ngsim.pairing.tracks import Tracks
from merge_cosim.ngsim.sites import Site

COLUMNS = ("episode", "frame", "car", "station_m", "speed_m_s")


def read_episodes(path: Path, site: Site, rules: PairRules, first: int = 0) -> Paired:
    """Pair the merging car of each episode with the nearest cars ahead and behind at its end; see `episode_tracks`."""
    return pair_tracks(episode_tracks(path, site, rules, first), site, rules, site.source)


def episode_tracks(path: Path, site: Site, rules: PairRules, first: int = 0) -> Tracks:
    """Read the cars of the episodes: the merging car, in the host lane only in its last row, and its neighbours there.

    Every length is missing. The episodes' positions carry no jitter (their second differences are as small as those
    of smoothed NGSIM positions, half of raw ones), so all are flagged `smoothed_source`.

    Args:
        path: The Parquet file, with `COLUMNS`.
        site: Where they were recorded.
        rules: The thresholds.
        first: Number of the first episode to use.

    Raises:
        UserError: A column is absent or not numeric, a value is missing, a car repeats or skips a frame, or an episode
            has no merging car.
    """
    columns = _columns(path)
    order = np.lexsort([columns[name] for name in ("frame", "car", "episode")])
    order = order[columns["episode"][order] >= first]
    episode, frame, car, station, speed = (columns[name][order] for name in COLUMNS)
    same_car = (np.diff(episode) == 0) & (np.diff(car) == 0)
    for row in np.flatnonzero(same_car & (np.diff(frame) != 1))[:1]:
        raise UserError(
            f"{path}: car {car[row]:g} of episode {episode[row]:g} goes from frame {frame[row]:g} to "
            f"{frame[row + 1]:g}; frames must follow each other"
        )
    for number in np.setdiff1d(episode, episode[car == 0])[:1]:
        raise UserError(f"{path}: episode {number:g} has no merging car (car 0)")
    breaks = np.flatnonzero(~same_car) + 1
    offsets = np.concatenate([[0], breaks, [len(order)]]) if len(order) else np.zeros(1, dtype=np.int64)
    changes = np.zeros(len(order), dtype=bool)
    changes[offsets[1:] - 1] = True
    changes &= car == 0
    smooth = smooth_tracks(station, offsets, rules.smoothing_window, rules.smoothing_order)
    starts = offsets[:-1]
    return Tracks(
        recording=np.array([f"episode-{number:g}" for number in episode[starts]], dtype=object),
        vehicle=car[starts].astype(np.int64),
        part=np.ones(len(starts), dtype=np.int64),
        first_frame=frame[starts].astype(np.int64),
        length=np.full(len(starts), np.nan),
        offsets=offsets,
        y=smooth + site.gore_y,
        speed=speed,
        on_ramp=(car == 0) & ~changes,
        in_host=(car != 0) | changes,
        lane=np.where((car != 0) | changes, site.host_lane, site.ramp_lanes[0]),
        smoothed=np.ones(len(order), dtype=bool),
    )


def _columns(path: Path) -> dict[str, FloatArray]:
    """Read and check the columns, as floats."""
    try:
        table = pq.read_table(path)
        names = table.column_names
    except (OSError, pa.ArrowInvalid, UnicodeDecodeError) as error:  # a column's name may be no text
        raise UserError(f"{path}: not a readable Parquet file; get it again") from error
    columns: dict[str, FloatArray] = {}
    for name in COLUMNS:
        if name not in names:
            raise UserError(f"{path}: no column {name!r}; merging episodes have {', '.join(COLUMNS)}")
        try:
            columns[name] = table[name].cast(pa.float64()).to_numpy()
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
            raise UserError(f"{path}: column {name!r} holds something that is not a number") from error
        for row in np.flatnonzero(~np.isfinite(columns[name]))[:1]:
            raise UserError(f"{path}: column {name!r} has no value in row {row + 1}")
    return columns

"""Recordings of another frame rate than 10 Hz, resampled; and the first rows of tracks left out."""

import math
from itertools import pairwise

import numpy as np
import pyarrow as pa

from merge_cosim.core.units import DT, TOLERANCE, IntArray
from merge_cosim.ngsim.table import SCHEMA

LINEAR = ("x", "speed")
"""Columns that are interpolated linearly; all others but `y` keep the value of the frame before."""


def without_first(table: pa.Table, count: int) -> pa.Table:
    """Leave out the first `count` rows of each part of a car's track."""
    starts = _starts(table)
    past = np.arange(table.num_rows) - np.repeat(starts, np.diff(np.append(starts, table.num_rows)))
    return table.filter(pa.array(past >= count)) if count else table


def at_10_hz(table: pa.Table, rate: float) -> pa.Table:
    """Resample a canonical table whose frames are `rate` per second; frame 0 stays at the same time.

    Positions along the road follow a piecewise cubic that passes through all logged ones and never runs backwards
    where they do not (PCHIP, Fritsch and Butland 1984). A part that holds no instant of the new clock is left out.

    Args:
        table: Rows of `table.SCHEMA`, sorted, each part without a gap.
        rate: Frames per second.
    """
    if math.isclose(rate * DT, 1.0):
        return table
    from scipy.interpolate import PchipInterpolator

    starts = _starts(table)
    time = table["frame"].to_numpy() / rate
    old = {name: table[name].to_numpy().astype(np.float64) for name in (*LINEAR, "y")}
    frames, before = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    new: dict[str, list[np.ndarray]] = {name: [np.empty(0)] for name in old}
    for start, end in pairwise([*starts.tolist(), table.num_rows]):
        here = time[start:end]
        frame = np.arange(math.ceil(here[0] / DT - TOLERANCE), math.floor(here[-1] / DT + TOLERANCE) + 1)
        at = np.clip(frame * DT, here[0], here[-1])
        frames.append(frame)
        before.append(start + np.searchsorted(here, at + TOLERANCE, side="right") - 1)
        for name in LINEAR:
            new[name].append(np.interp(at, here, old[name][start:end]))
        y = old["y"][start:end]
        new["y"].append(PchipInterpolator(here, y)(at) if len(y) > 1 else y[: len(at)])
    result = table.take(pa.array(np.concatenate(before)))
    for name, parts in {**new, "frame": frames}.items():
        result = result.set_column(SCHEMA.get_field_index(name), name, pa.array(np.concatenate(parts)))
    return result.cast(SCHEMA)


def _starts(table: pa.Table) -> IntArray:
    """First row of each part of a car's track."""
    if not table.num_rows:
        return np.empty(0, dtype=np.int64)
    recording = table["recording"].unify_dictionaries().combine_chunks().indices.to_numpy()
    keys = (recording, table["vehicle_id"].to_numpy(), table["part"].to_numpy())
    return np.flatnonzero(np.append(True, np.logical_or.reduce([np.diff(key) != 0 for key in keys])))

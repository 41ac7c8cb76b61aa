"""The canonical trajectory table: one schema in SI units, sorted, without duplicates, cut into gap-free parts."""

from dataclasses import dataclass
from datetime import datetime
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa

from merge_cosim.core.units import BoolArray, IntArray

_NAME = pa.dictionary(pa.int32(), pa.string())

SCHEMA = pa.schema(
    [
        ("site", _NAME),
        ("recording", _NAME),
        ("vehicle_id", pa.int32()),
        ("part", pa.int16()),
        ("frame", pa.int32()),
        ("x", pa.float32()),
        ("y", pa.float64()),
        ("speed", pa.float64()),
        ("length", pa.float32()),
        ("width", pa.float32()),
        ("lane", pa.int16()),
        ("smoothed", pa.bool_()),
    ]
)
"""Columns of the canonical table, one row per car and frame (10 Hz):

- `site`; `recording`: the stretch of time whose frames stand on one clock; `vehicle_id`: unique within a recording;
- `part`: gap-free piece of a car's track, counted from 1; `frame`: frame number within the recording;
- `x`, `y` [m]: front bumper across the road (0 where not logged) and along it, in NGSIM Local_X and Local_Y;
- `speed` [m/s];
- `length`, `width` [m], NaN where not logged; `lane`: the recording's lane number;
- `smoothed`: the source's positions were smoothed before they were published.
"""

CLOCK_SPREAD_MS = 60_000
"""Clock origins closer than this [ms] belong to one recording."""

LATEST_MS = 4_102_444_800_000
"""Clock origins after this (the year 2100) are none [ms since 1970]."""

CONFLICT_M = 0.01
"""Rows of one car and frame whose positions differ by more than this [m] contradict each other."""

_LOCAL_TIME = ZoneInfo("America/Los_Angeles")


@dataclass(frozen=True)
class Repeats:
    """How many rows repeated the car and frame of an earlier row and were dropped.

    Attributes:
        dropped: All of them.
        conflicting: Those among them at another position; the row that came first was kept.
    """

    dropped: int = 0
    conflicting: int = 0

    def __add__(self, other: "Repeats") -> "Repeats":
        return Repeats(self.dropped + other.dropped, self.conflicting + other.conflicting)


class ClockError(ValueError):
    """Global_Time and Frame_ID do not advance together."""


SIMULATED = "surrogate_"
"""Beginning of the names of the surrogate's recordings, by which its files are recognised as simulated."""


def name_recordings(origins: IntArray) -> pa.DictionaryArray:
    """Name each row's recording after its clock origin, in local time rounded to the minute: `2005-06-15T0750`.

    Args:
        origins: `Global_Time - 100 ms * Frame_ID` [ms since 1970], constant within an original file. Shape (n,).

    Raises:
        ClockError: Origins drift through more than `CLOCK_SPREAD_MS`, so they separate no recordings, or are no times.
    """
    distinct, row = np.unique(origins, return_inverse=True)
    first = np.concatenate([[True], np.diff(distinct) > CLOCK_SPREAD_MS])
    cluster = np.cumsum(first) - 1
    starts = distinct[first]
    if np.any(distinct - starts[cluster] > CLOCK_SPREAD_MS) or np.any((starts < 0) | (starts > LATEST_MS)):
        raise ClockError
    minutes = (starts + 30_000) // 60_000
    names = [datetime.fromtimestamp(int(minute) * 60, _LOCAL_TIME).strftime("%Y-%m-%dT%H%M") for minute in minutes]
    return pa.DictionaryArray.from_arrays(cluster[row].astype(np.int32), names)


def canonical(table: pa.Table) -> tuple[pa.Table, Repeats]:
    """Sort rows of `SCHEMA`, drop repeated ones and begin a new part at every frame gap.

    Of rows with the same site, recording, car, part and frame the first is kept. Calling it again changes nothing.
    """
    table = table.unify_dictionaries()
    keys = [_ranks(table["site"]), _ranks(table["recording"])]
    keys += [table[name].to_numpy() for name in ("vehicle_id", "part", "frame")]
    order = np.lexsort(keys[::-1])
    site, recording, vehicle, part, frame = (key[order] for key in keys)

    same_car = _same(site) & _same(recording) & _same(vehicle)
    same_part = same_car & _same(part)
    repeated = same_part & _same(frame)
    repeats = _count(table, order, repeated)
    kept = ~repeated
    if repeats.dropped:
        order, same_car, same_part, frame = order[kept], same_car[kept], same_part[kept], frame[kept]

    gap = np.diff(frame, prepend=frame[:1]) != 1
    number = np.cumsum(same_car & (~same_part | gap))
    first_row = np.maximum.accumulate(np.where(same_car, 0, np.arange(len(number))))
    part = (number - number[first_row] + 1).astype(np.int16)
    table = table.take(pa.array(order)).set_column(SCHEMA.get_field_index("part"), "part", pa.array(part))
    return table.cast(SCHEMA), repeats


def _ranks(column: pa.ChunkedArray) -> IntArray:
    """Number a dictionary column's rows by the alphabetical order of their values."""
    values = column.combine_chunks()
    rank = np.argsort(np.argsort(np.array(values.dictionary.to_pylist(), dtype=str)))
    return rank[values.indices.to_numpy()].astype(np.int32)


def _same(key: IntArray) -> BoolArray:
    """Which rows have the value of the row before."""
    return np.concatenate([[False], key[1:] == key[:-1]])[: len(key)]


def _count(table: pa.Table, order: IntArray, repeated: BoolArray) -> Repeats:
    """Count the repeated rows, and those of them that are elsewhere than the row that is kept."""
    where = np.flatnonzero(repeated)
    if not len(where):
        return Repeats()
    kept = np.maximum.accumulate(np.where(repeated, 0, np.arange(len(repeated))))[where]
    apart = np.zeros(len(where), dtype=bool)
    for name in ("x", "y"):
        values = table[name].to_numpy()
        apart |= np.abs(values[order[where]] - values[order[kept]]) > CONFLICT_M
    return Repeats(len(where), int(apart.sum()))

"""Turning a block of a file, in the file's own columns and units, into canonical rows of each site."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.ngsim.clean import OPTIONAL, Place, checked, numbers
from merge_cosim.ngsim.formats import Source, missing_columns
from merge_cosim.ngsim.sites import SITES, Site
from merge_cosim.ngsim.table import SCHEMA

CLOCK = "Global_Time"
"""The column [ms since 1970] that tells the recordings apart where the file does not name them."""

FRAME_MS = 100
"""Time from one frame to the next [ms]."""

RAW_SOURCE = "commonroad:"
"""Rows whose `source` begins so have positions as NGSIM published them; those of any other source are smoothed."""


@dataclass(frozen=True)
class Piece:
    """A block's rows of each site, with the clock origin [ms] in place of the recording where the file has none."""

    tables: dict[str, pa.Table]
    rows: int
    elsewhere: Counter[str]


def needed_columns(source: Source, assumed: Site | None) -> list[str]:
    """Return the columns to read, as the file spells them."""
    missing = missing_columns(source, source.layout)
    clock = [] if source.find(source.layout.recording) else [CLOCK]
    missing += [name for name in clock if not source.find(name)]
    if missing:
        raise UserError(
            f"{source}: no column {' and no column '.join(missing)}; the columns are {', '.join(source.columns)}"
        )
    site = [name for name in ("Location", "site") if source.find(name)][:1] or ["Global_X", "Global_Y"]
    if not all(map(source.find, site)):
        if not assumed:
            raise UserError(
                f"{source}: no column Location, nor Global_X and Global_Y, tells its site: "
                "name it with 'merge-cosim ngsim import --site'"
            )
        site = []
    wanted = [*site, *clock, source.layout.recording, *source.layout.numbers.values(), "source", "smoothed"]
    return [column for name in wanted if (column := source.find(name))]


def convert(raw: pa.Table, first: int, source: Source, assumed: Site | None) -> Piece:
    """Turn one block of a file into canonical rows of each site; `first` is the number of its first row."""
    every = Place(source, first + np.arange(raw.num_rows))
    codes, elsewhere = _site_codes(raw, every, assumed)
    tables = {}
    for code, site in enumerate(SITES):
        rows = np.flatnonzero(codes == code)
        if len(rows):
            part = raw if len(rows) == raw.num_rows else raw.filter(pa.array(codes == code))
            tables[site.name] = _rows(part, site, Place(source, every.rows[rows]))
    return Piece(tables, raw.num_rows, elsewhere)


def _site_codes(raw: pa.Table, place: Place, assumed: Site | None) -> tuple[IntArray, Counter[str]]:
    """Tell the site of each row (its place in `SITES`, -1 for none) and count the rows of other sites."""
    source = place.source
    column = source.find("Location") or source.find("site")
    if column:
        names = _texts(raw, column)
        known = {key: code for code, site in enumerate(SITES) for key in (site.name, site.location)}
        sites = [name.strip().lower() for name in names.dictionary.to_pylist()]
        code_of = np.array([known.get(name, -1) for name in sites], dtype=np.int64)
        row_site = names.indices.to_numpy()
        counts = np.bincount(row_site, minlength=len(sites))
        elsewhere = {name or "no site": int(counts[i]) for i, name in enumerate(sites) if name not in known}
        return code_of[row_site], Counter(elsewhere)
    x, y = source.find("Global_X"), source.find("Global_Y")
    if x is None or y is None:
        assert assumed is not None
        return np.full(raw.num_rows, SITES.index(assumed)), Counter()
    codes = np.full(raw.num_rows, -1)
    east, north = numbers(raw[x], x, place), numbers(raw[y], y, place)
    for code, site in enumerate(SITES):
        (west, right), (south, top) = site.global_x, site.global_y
        codes[(west <= east) & (east <= right) & (south <= north) & (north <= top)] = code
    outside = int((codes < 0).sum())
    return codes, Counter({"outside both study areas": outside} if outside else {})


def _rows(raw: pa.Table, site: Site, place: Place) -> pa.Table:
    """Return one site's rows in the canonical columns, checked."""
    source = place.source
    values = {"part": np.ones(raw.num_rows)} | {name: np.full(raw.num_rows, np.nan) for name in OPTIONAL}
    for name, spelled in source.layout.numbers.items():
        if column := source.find(spelled):
            values[name] = checked(raw[column], column, name, place)
    columns = {
        name: pa.array(array.astype(SCHEMA.field(name).type.to_pandas_dtype())) for name, array in values.items()
    }
    columns["site"] = pa.DictionaryArray.from_arrays(np.zeros(raw.num_rows, dtype=np.int32), [site.name])
    columns["smoothed"] = _smoothed(raw, source)
    columns["recording"] = _recording(raw, values["frame"], place)
    return pa.table({name: columns[name] for name in SCHEMA.names})


def _recording(raw: pa.Table, frame: FloatArray, place: Place) -> pa.Array:
    """Return each row's recording, or its clock origin [ms] where the file names none."""
    if column := place.source.find(place.source.layout.recording):
        names = _texts(raw, column)
        empty = np.array([not name for name in names.dictionary.to_pylist()], dtype=bool)[names.indices.to_numpy()]
        if empty.any():
            raise place.error(int(np.argmax(empty)), f"{column} is empty")
        return names
    column = place.source.find(CLOCK)
    assert column is not None
    return pa.array((numbers(raw[column], column, place) - FRAME_MS * frame).astype(np.int64))


def _texts(raw: pa.Table, column: str) -> pa.DictionaryArray:
    """Return a column of names, empty where there is none."""
    return raw[column].cast(pa.string()).fill_null("").dictionary_encode().combine_chunks()


def _smoothed(raw: pa.Table, source: Source) -> pa.Array:
    """Tell which rows come from smoothed positions."""
    if column := source.find("smoothed"):
        return raw[column].cast(pa.bool_()).combine_chunks()
    if column := source.find("source"):
        raw_positions = pc.starts_with(raw[column].cast(pa.string()), RAW_SOURCE)
        return pc.invert(raw_positions).combine_chunks()
    return pa.array(np.zeros(raw.num_rows, dtype=bool))

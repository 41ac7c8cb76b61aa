"""Turning a block of a file, in the file's own columns and units, into canonical rows of each site."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.ngsim.clean import OPTIONAL, Place, checked, numbers
from merge_cosim.ngsim.formats import OWN, Source, missing_columns
from merge_cosim.ngsim.sites import Site, shipped_sites
from merge_cosim.ngsim.table import LATEST_MS, SCHEMA

CLOCK = "Global_Time"
"""The column [ms since 1970] by which recordings are distinguished where the file does not name them."""

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
    layout = source.layout
    missing = missing_columns(source, layout)
    clock = [] if layout.of_site or source.find(layout.recording) else [CLOCK]
    missing += [name for name in clock if not source.find(name)]
    if layout.of_site and layout.recording and not source.find(layout.recording):
        missing.append(layout.recording)
    if missing:
        raise UserError(
            f"{source}: no column {' and no column '.join(missing)}; the columns are {', '.join(source.columns)}"
        )
    wanted = [*_site_columns(source, assumed), *clock, layout.recording, *layout.numbers.values(), "source", "smoothed"]
    found = list(dict.fromkeys(column for name in wanted if (column := source.find(name))))
    spelled = [column.lower() for column in source.columns]
    if twice := [column for column in found if spelled.count(column.lower()) > 1]:
        raise UserError(f"{source}: two columns are called {twice[0]}; remove one")
    return found


def convert(raw: pa.Table, first: int, source: Source, assumed: Site | None) -> Piece:
    """Turn one block of a file into canonical rows of each site; `first` is the number of its first row."""
    every = Place(source, first + np.arange(raw.num_rows))
    sites, codes, elsewhere = _sites(raw, every, assumed)
    tables = {}
    for code, site in enumerate(sites):
        rows = np.flatnonzero(codes == code)
        if len(rows):
            part = raw if len(rows) == raw.num_rows else raw.filter(pa.array(codes == code))
            tables[site] = _rows(part, site, Place(source, every.rows[rows]))
    return Piece(tables, raw.num_rows, elsewhere)


def _site_columns(source: Source, assumed: Site | None) -> list[str]:
    """The columns that give the rows' sites; none where the layout is one site's own."""
    if source.layout.of_site:
        return []
    columns = [name for name in ("Location", "site") if source.find(name)][:1] or ["Global_X", "Global_Y"]
    if all(map(source.find, columns)):
        return columns
    if not assumed:
        raise UserError(
            f"{source}: no column Location, nor Global_X and Global_Y, gives its site: "
            "name it with 'merge-cosim ngsim import --site'"
        )
    return []


def _sites(raw: pa.Table, place: Place, assumed: Site | None) -> tuple[list[str], IntArray, Counter[str]]:
    """Name the sites of a block, find each row's place among them (-1: none), and count the rows of other sites.

    In the canonical layout every site counts; in NGSIM's, the shipped ones and the one that is assumed.
    """
    source, columns = place.source, _site_columns(place.source, assumed)
    if not columns:
        assert assumed is not None
        return [assumed.name], np.zeros(raw.num_rows, dtype=np.int64), Counter()
    wanted = [*shipped_sites(), *([assumed] if assumed else [])]
    if len(columns) == 1:
        known = {key.lower(): site.name for site in wanted for key in (site.name, site.recording.location) if key}
        names = _texts(raw, source.find(columns[0]) or "")
        written = [name.strip() for name in names.dictionary.to_pylist()]
        meant = [known.get(name.lower(), name if source.layout is OWN else "") for name in written]
        found = sorted({name for name in meant if name})
        row_name = names.indices.to_numpy()
        counts = np.bincount(row_name, minlength=len(written))
        elsewhere = {name.lower() or "no site": int(counts[i]) for i, name in enumerate(written) if not meant[i]}
        codes = np.array([found.index(name) if name else -1 for name in meant], dtype=np.int64)
        return found, codes[row_name], Counter(elsewhere)
    codes = np.full(raw.num_rows, -1)
    east, north = (numbers(raw[column], column, place) for name in columns if (column := source.find(name)))
    for code, site in enumerate(wanted):
        if site.recording.global_x and site.recording.global_y:
            (west, right), (south, top) = site.recording.global_x, site.recording.global_y
            codes[(west <= east) & (east <= right) & (south <= north) & (north <= top)] = code
    outside = int((codes < 0).sum())
    return [site.name for site in wanted], codes, Counter({"outside all study areas": outside} if outside else {})


def _rows(raw: pa.Table, site: str, place: Place) -> pa.Table:
    """Return one site's rows in the canonical columns, checked."""
    source, layout = place.source, place.source.layout
    values = {"part": np.ones(raw.num_rows), "x": np.zeros(raw.num_rows)}
    values |= {name: np.full(raw.num_rows, np.nan) for name in OPTIONAL}
    for name, spelled in layout.numbers.items():
        if column := source.find(spelled):
            values[name] = checked(raw[column], column, name, place)
    if "time" in values:
        values["frame"] = np.rint(values.pop("time") * layout.rate)
    if layout.to_front:
        length = values["length"]
        values["y"] = values["y"] + layout.to_front * np.where(np.isnan(length), layout.default_length, length)
    columns = {
        name: pa.array(array.astype(SCHEMA.field(name).type.to_pandas_dtype())) for name, array in values.items()
    }
    columns["site"] = pa.DictionaryArray.from_arrays(np.zeros(raw.num_rows, dtype=np.int32), [site])
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
    if place.source.layout.of_site:
        return pa.array([place.source.path.stem] * raw.num_rows).dictionary_encode()
    column = place.source.find(CLOCK)
    assert column is not None
    origin = numbers(raw[column], column, place) - FRAME_MS * frame
    return pa.array(
        np.clip(origin, -1.0, LATEST_MS + 1.0).astype(np.int64)
    )  # values that are no times stay outside the range


def _texts(raw: pa.Table, column: str) -> pa.DictionaryArray:
    """Return a column of names, empty where there is none."""
    return raw[column].cast(pa.string()).fill_null("").dictionary_encode().combine_chunks()


def _smoothed(raw: pa.Table, source: Source) -> pa.Array:
    """Which rows come from smoothed positions."""
    if source.layout.of_site:
        return pa.array(np.full(raw.num_rows, source.layout.smoothed))
    if column := source.find("smoothed"):
        return raw[column].cast(pa.bool_()).combine_chunks()
    if column := source.find("source"):
        raw_positions = pc.starts_with(raw[column].cast(pa.string()), RAW_SOURCE)
        return pc.invert(raw_positions).combine_chunks()
    return pa.array(np.zeros(raw.num_rows, dtype=bool))

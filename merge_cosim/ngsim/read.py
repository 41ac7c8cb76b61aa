"""Reading one trajectory file, block by block, into the canonical table of each site."""

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.blocks import map_blocks
from merge_cosim.ngsim.formats import NGSIM, Kind, Source, sources
from merge_cosim.ngsim.resample import at_10_hz, without_first
from merge_cosim.ngsim.rows import Piece, convert, needed_columns
from merge_cosim.ngsim.sites import Site
from merge_cosim.ngsim.table import SCHEMA, ClockError, Repeats, canonical, name_recordings


@dataclass(frozen=True)
class Reading:
    """The content of a file.

    Attributes:
        tables: The canonical table of each site (by name) that has rows in it.
        rows: Rows in the file.
        elsewhere: Rows passed over, by the site that they name.
        repeats: Rows dropped because they repeat an earlier one.
    """

    tables: dict[str, pa.Table]
    rows: int = 0
    elsewhere: Counter[str] = field(default_factory=Counter)
    repeats: Repeats = field(default_factory=Repeats)

    @property
    def holds(self) -> str:
        """The sites in the file, for a message."""
        return ", ".join([*self.tables, *self.elsewhere]) or "no row"


def read_file(path: Path, assumed: Site | None = None) -> Reading:
    """Read a trajectory file of any format into canonical tables.

    Args:
        path: Text, CSV or Parquet; text also packed with gzip or in a zip archive.
        assumed: The site of a file that does not name one, or that has this site's own layout.

    Raises:
        UserError: The file holds no trajectories, lacks a column, is damaged or holds an impossible value.
    """
    found = sources(path, assumed.layout if assumed else NGSIM)
    usable = [source for source in found if source.kind is Kind.TRAJECTORIES]
    if not usable:
        raise UserError(f"{path}: not trajectory data: {found[0].note or found[0].kind}" if found else f"{path}: empty")
    readings = [_read(source, assumed) for source in usable]
    return readings[0] if len(readings) == 1 else merge(readings)


def merge(readings: Iterable[Reading]) -> Reading:
    """Join the content of several files; a row that is in two of them is kept once."""
    tables: dict[str, list[pa.Table]] = defaultdict(list)
    rows, elsewhere, repeats = 0, Counter[str](), Repeats()
    for reading in readings:
        rows, elsewhere, repeats = rows + reading.rows, elsewhere + reading.elsewhere, repeats + reading.repeats
        for name, table in reading.tables.items():
            tables[name].append(table)
    joined = {}
    for name, parts in tables.items():
        joined[name], more = canonical(pa.concat_tables(parts))
        repeats += more
    return Reading(joined, rows, elsewhere, repeats)


def _read(source: Source, assumed: Site | None) -> Reading:
    """Read one text or Parquet file."""
    rows, elsewhere = 0, Counter[str]()
    pieces: dict[str, list[pa.Table]] = defaultdict(list)

    def work(block: pa.Table, first: int) -> Piece:
        return convert(block, first, source, assumed)

    try:
        for piece in map_blocks(source, needed_columns(source, assumed), work):
            rows += piece.rows
            elsewhere += piece.elsewhere
            for name, table in piece.tables.items():
                pieces[name].append(table)
    except pa.ArrowException as error:  # a column of lists, of dates, twice by the same name
        raise UserError(f"{source}: its columns cannot be taken as trajectories: {error}") from None
    tables, repeats = {}, Repeats()
    for name in list(pieces):
        try:
            tables[name], repeated = canonical(_with_recording(pa.concat_tables(pieces.pop(name))))
        except ClockError:
            raise UserError(
                f"{source}: Global_Time does not advance by 100 ms per Frame_ID: take the file as it was published "
                "(a spreadsheet rounds such numbers)"
            ) from None
        whole = without_first(tables[name], source.layout.skip_first)
        tables[name] = at_10_hz(whole, source.layout.rate)
        repeats += repeated
    return Reading(tables, rows, elsewhere, repeats)


def _with_recording(table: pa.Table) -> pa.Table:
    """Name the recordings of rows that carry a clock origin."""
    index = SCHEMA.get_field_index("recording")
    if pa.types.is_integer(table.schema.field(index).type):
        table = table.set_column(index, "recording", name_recordings(table["recording"].to_numpy()))
    return table

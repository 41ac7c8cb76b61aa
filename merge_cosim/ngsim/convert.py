"""Writing files of any NGSIM format as canonical Parquet, one file per site."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.read import merge, read_file
from merge_cosim.ngsim.sites import Site
from merge_cosim.ngsim.table import Repeats


@dataclass(frozen=True)
class Recording:
    """Extent of one recording."""

    site: str
    recording: str
    rows: int
    cars: int


@dataclass(frozen=True)
class Conversion:
    """What was read and written.

    Attributes:
        rows: Rows in the files.
        kept: Rows written.
        repeats: Rows dropped because they repeat an earlier one.
        elsewhere: Rows passed over, by the site that they name.
        recordings: What was written.
        written: The files written, by site.
    """

    rows: int
    kept: int
    repeats: Repeats
    elsewhere: dict[str, int]
    recordings: list[Recording]
    written: dict[str, Path]


def convert(files: Sequence[Path], out: Path, wanted: Site | None = None) -> Conversion:
    """Read `files` and write `OUT/SITE-trajectories.parquet`.

    Args:
        files: Trajectory files of any format.
        out: Folder to write to, made where it is missing.
        wanted: The only site to keep, and the site of files that name none; None keeps every site.

    Raises:
        UserError: A file is not trajectory data, is damaged, or has no row of a site that is kept.
    """
    readings = [read_file(path, wanted) for path in files]
    for path, reading in zip(files, readings, strict=True):
        if not reading.tables or (wanted and wanted.name not in reading.tables):
            raise UserError(f"{path}: no row of {wanted.name if wanted else 'a known site'} (it has {reading.holds})")
    everything = merge(readings) if len(readings) > 1 else readings[0]
    tables = {name: table for name, table in everything.tables.items() if not wanted or name == wanted.name}
    elsewhere = everything.elsewhere + Counter(
        {name: table.num_rows for name, table in everything.tables.items() if name not in tables}
    )
    for name in tables:
        if Path(name).name != name:
            raise UserError(f"{files[0]}: site '{name}': no name for a file; rename it, or choose one by --site")
    written = {name: out / f"{name}-trajectories.parquet" for name in tables}
    if overwritten := {path.resolve() for path in written.values()} & {path.resolve() for path in files}:
        raise UserError(f"{overwritten.pop()}: would be overwritten: choose another --out")
    out.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        pq.write_table(table, written[name])
    recordings = [recording for table in tables.values() for recording in extents(table)]
    kept = sum(table.num_rows for table in tables.values())
    return Conversion(everything.rows, kept, everything.repeats, dict(elsewhere), recordings, written)


def extents(table: pa.Table) -> list[Recording]:
    """Count the rows and the cars of each recording of a canonical table."""
    counts = table.group_by(["site", "recording"], use_threads=False).aggregate(
        [("vehicle_id", "count"), ("vehicle_id", "count_distinct")]
    )
    return [
        Recording(row["site"], row["recording"], row["vehicle_id_count"], row["vehicle_id_count_distinct"])
        for row in counts.to_pylist()
    ]

"""The user's data: where it is, what each file holds, and the trajectories of a site, cached."""

import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import cache_folder, from_cache
from merge_cosim.ngsim.download import UNFINISHED
from merge_cosim.ngsim.formats import NGSIM, Kind, Layout, sources
from merge_cosim.ngsim.read import Reading, merge, read_file
from merge_cosim.ngsim.sites import Site, shipped_sites, site
from merge_cosim.ngsim.table import Repeats

READER_VERSION = 2
"""Raised when the same file would be read differently, so that cached tables are made anew."""

FACTS = "reading.json"
"""The file of a cached reading that names its tables."""

ENVIRONMENT = "MERGE_COSIM_DATA"
"""Environment variable that names the data folder."""


@dataclass(frozen=True)
class DataFile:
    """One file in a data folder.

    Attributes:
        path: The file.
        kind: What it holds; of a zip archive, trajectories if any member does.
        note: Why it is passed over, else empty.
    """

    path: Path
    kind: Kind
    note: str = ""


def find_data(option: str | Path | None) -> Path | None:
    """Return the data folder (or file): the option, else `$MERGE_COSIM_DATA`, else `./data` unless empty, else None.

    Raises:
        UserError: What the option or the variable names does not exist.
    """
    for named, where in ((option, "--data"), (os.environ.get(ENVIRONMENT) or None, f"${ENVIRONMENT}")):
        if named is not None:
            if not Path(named).exists():
                raise UserError(f"{named}: no such folder (from {where})")
            return Path(named)
    usual = Path("data")
    return usual if usual.is_dir() and any(usual.iterdir()) else None


def data_files(data: Path, layout: Layout = NGSIM) -> list[DataFile]:
    """Look into every file of a data folder (or at the one file named), sorted by path.

    Raises:
        UserError: A file is damaged.
    """
    if data.is_file():
        return [_look(data, layout)]
    paths = (path for path in data.rglob("*") if path.is_file())
    shown = (path for path in sorted(paths) if not any(p.startswith(".") for p in path.relative_to(data).parts))
    return [_look(path, layout) for path in shown]


def episode_files(data: Path) -> list[Path]:
    """Return the files of a data folder that hold merging episodes."""
    return [file.path for file in data_files(data) if file.kind is Kind.EPISODES]


def load_trajectories(data: Path | Iterable[Path], wanted: str | Site) -> pa.Table | None:
    """Return the canonical table (`table.SCHEMA`) of one site.

    Args:
        data: A data folder, whose other files are passed over; or files, which must hold trajectories of the site
            (those with episodes excepted: they are read elsewhere).
        wanted: The site or its name.

    Returns:
        The rows of all files, or None where there are none of this site.

    Raises:
        UserError: A file is damaged, or a named one holds no row of the site.
    """
    wanted = site(wanted) if isinstance(wanted, str) else wanted
    if isinstance(data, Path) and data.is_dir():
        paths = [file.path for file in data_files(data, wanted.layout) if file.kind is Kind.TRAJECTORIES]
        readings = [cached(path, wanted) for path in paths]
    else:
        named = [data] if isinstance(data, Path) else list(data)
        paths = [path for path in named if _look(path, wanted.layout).kind is not Kind.EPISODES]
        readings = [cached(path, wanted) for path in paths]
        for path, reading in zip(paths, readings, strict=True):
            if wanted.name not in reading.tables:
                raise UserError(f"{path}: no row of {wanted.name} (it has {reading.holds})")
    held = [Reading({wanted.name: r.tables[wanted.name]}) for r in readings if wanted.name in r.tables]
    if not held:
        return None
    return held[0].tables[wanted.name] if len(held) == 1 else merge(held).tables[wanted.name]


def cached(path: Path, wanted: Site | None = None) -> Reading:
    """Read a trajectory file, or take its tables from the cache if it was read before and has not changed.

    Args:
        path: The file.
        wanted: The site that is looked for; a shipped one of NGSIM's format is found in the file itself.
    """
    if wanted and wanted.recording.format == "ngsim" and wanted in shipped_sites():
        wanted = None
    try:
        state = path.resolve().stat()
    except OSError:
        return read_file(path, wanted)
    key = f"{path.resolve()}|{state.st_size}|{state.st_mtime_ns}|{READER_VERSION}"
    key += f"|{wanted!r}" if wanted else ""
    folder = cache_folder("ngsim") / hashlib.sha256(key.encode()).hexdigest()[:16]
    from_cache(folder, lambda made: _store(read_file(path, wanted), made))
    facts = json.loads((folder / FACTS).read_bytes())
    tables = {name: pq.read_table(folder / f"{number}.parquet") for number, name in enumerate(facts["sites"])}
    return Reading(tables, facts["rows"], Counter(facts["elsewhere"]), Repeats(**facts["repeats"]))


def _store(reading: Reading, folder: Path) -> None:
    """Write a reading's tables and facts; a site's name may be no file name."""
    folder.mkdir()
    for number, table in enumerate(reading.tables.values()):
        pq.write_table(table, folder / f"{number}.parquet")
    facts = {
        "sites": list(reading.tables),
        "rows": reading.rows,
        "elsewhere": reading.elsewhere,
        "repeats": asdict(reading.repeats),
    }
    (folder / FACTS).write_text(json.dumps(facts))


def _look(path: Path, layout: Layout) -> DataFile:
    if path.suffix == UNFINISHED:
        return DataFile(path, Kind.OTHER, "an unfinished download")
    found = sources(path, layout)
    kinds = [source.kind for source in found]
    if Kind.TRAJECTORIES in kinds:
        return DataFile(path, Kind.TRAJECTORIES)
    if not found:
        return DataFile(path, Kind.OTHER, "it is empty")
    return DataFile(path, found[0].kind, found[0].note)

"""Recognising trajectory files by their content: what a file holds, which columns, and how to open it."""

import csv
import gzip
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import BinaryIO, cast

import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FOOT

TEXT_COLUMNS = (
    "Vehicle_ID",
    "Frame_ID",
    "Total_Frames",
    "Global_Time",
    "Local_X",
    "Local_Y",
    "Global_X",
    "Global_Y",
    "v_Length",
    "v_Width",
    "v_Class",
    "v_Vel",
    "v_Acc",
    "Lane_ID",
    "Preceding",
    "Following",
    "Space_Headway",
    "Time_Headway",
)
"""Columns of the original text files, which have no header."""

MAX_MISSING = 2
"""A file that lacks at most so many of a layout's required columns is meant to be of that layout."""

_MAX_HEADER = 1 << 16
_UNDECODED = "\ufffd"
_PARQUET, _ZIP, _GZIP = b"PAR1", b"PK\x03\x04", b"\x1f\x8b"
_EPISODES = {"episode", "frame", "car", "station_m", "speed_m_s"}


class Kind(StrEnum):
    """What a file holds."""

    TRAJECTORIES = "trajectories"
    EPISODES = "merging episodes"
    NO_CLOCK = "no clock"
    OTHER = "other"


LIMITS = {
    "vehicle_id": (-1e8, 1e8),
    "part": (0, 10_000),
    "frame": (0, 1e8),
    "time": (0, 1e8),
    "x": (-50.0, 100.0),
    "y": (-100.0, 1000.0),
    "speed": (-1.0, 100.0),
    "length": (0.0, 50.0),
    "width": (0.0, 10.0),
    "lane": (0, 20),
}
"""Smallest and largest possible value of each canonical column in NGSIM's files [m, m/s]: anything else is a damaged
file. The lowest speed leaves room for the noise of a standing car."""

WIDE = LIMITS | {"x": (-1e6, 1e6), "y": (-1e6, 1e6), "lane": (-32_768, 32_767)}
"""The same for recordings of any site, which choose their own zero and lane numbers."""

COLUMNS = (*LIMITS, "recording")
"""What a recording's columns can be: the canonical ones, and `time` [s] in place of `frame`."""


@dataclass(frozen=True)
class Layout:
    """How a format names the canonical columns, and what else is known of it.

    Attributes:
        numbers: The format's name of each canonical column of numbers; matched without regard to case.
        recording: Its name of the column that names the recording, if it has one.
        unit: Metres per unit of length.
        limits: Possible values of each canonical column [m, m/s].
        optional: Canonical columns that a file may lack.
        of_site: It is one site's own: all rows are of that site, and a file without a `recording` is one recording.
        rate: Frames per second.
        skip_first: Rows left out at the start of each track.
        to_front: Car lengths from the logged point of a car to its front bumper.
        default_length: Length of a car whose length was not logged, for `to_front` [m].
        smoothed: Positions were smoothed before they were published (where no column says so).
    """

    numbers: dict[str, str]
    recording: str
    unit: float
    limits: dict[str, tuple[float, float]]
    optional: tuple[str, ...] = ("part", "length", "width")
    of_site: bool = False
    rate: float = 10.0
    skip_first: int = 0
    to_front: float = 0.0
    default_length: float = 5.0
    smoothed: bool = False

    @property
    def required(self) -> list[str]:
        """Names of the columns of numbers that every file has."""
        return [column for name, column in self.numbers.items() if name not in self.optional]


NGSIM = Layout(
    {
        "vehicle_id": "Vehicle_ID",
        "part": "track_part",
        "frame": "Frame_ID",
        "x": "Local_X",
        "y": "Local_Y",
        "speed": "v_Vel",
        "length": "v_Length",
        "width": "v_Width",
        "lane": "Lane_ID",
    },
    recording="segment",
    unit=FOOT,
    limits=LIMITS,
)
"""The published files and what keeps their names."""

OWN = Layout({name: name for name in NGSIM.numbers}, recording="recording", unit=1.0, limits=WIDE)
"""The canonical table."""


@dataclass(frozen=True)
class Source:
    """One file, or one member of a zip archive, and what its beginning shows.

    Attributes:
        path: The file.
        kind: What it holds.
        layout: Its names and unit, where it holds trajectories.
        columns: Its columns as it spells them.
        parquet: Parquet, else text.
        header: A text's first line names the columns.
        blanks: A text's columns are separated by blanks, else by commas.
        member: Name in the zip archive.
        note: Why it is not trajectory data.
    """

    path: Path
    kind: Kind
    layout: Layout = NGSIM
    columns: tuple[str, ...] = ()
    parquet: bool = False
    header: bool = True
    blanks: bool = False
    member: str = ""
    note: str = ""

    def __str__(self) -> str:
        return f"{self.path}:{self.member}" if self.member else str(self.path)

    def find(self, name: str) -> str | None:
        """Return the file's own spelling of a column, or None where it lacks it."""
        return next((column for column in self.columns if column.lower() == name.lower()), None)


def sources(path: Path, layout: Layout = NGSIM) -> list[Source]:
    """Look into a file: one source, or one for each member of a zip archive.

    Raises:
        UserError: The file is missing, cannot be read or is damaged.
    """
    try:
        with path.open("rb") as file:
            magic = file.read(4)
        if magic == _PARQUET:
            columns = tuple(pq.read_schema(path).names)
            return [_with_layout(Source(path, Kind.OTHER, columns=columns, parquet=True), layout)]
        if magic == _ZIP:
            with zipfile.ZipFile(path) as archive:
                members = [info.filename for info in archive.infolist() if not info.is_dir()]
            return [_text(path, layout, member) for member in members]
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (pa.ArrowInvalid, UnicodeDecodeError, zipfile.BadZipFile):  # a column's name may be no text
        raise UserError(f"{path}: damaged or cut short: download or copy it again") from None
    return [_text(path, layout)]


@contextmanager
def open_text(path: Path, member: str = "") -> Iterator[BinaryIO]:
    """Open a text file for reading, through gzip or out of a zip archive.

    Raises:
        UserError: The packed data prove damaged while they are read.
    """
    try:
        if member:
            with zipfile.ZipFile(path) as archive, archive.open(member) as inside:
                yield cast(BinaryIO, inside)
            return
        with path.open("rb") as file:
            packed = file.read(2) == _GZIP
            file.seek(0)
            yield cast(BinaryIO, gzip.GzipFile(fileobj=file)) if packed else file
    except (EOFError, gzip.BadGzipFile, zlib.error, zipfile.BadZipFile):
        raise UserError(f"{path}: damaged or cut short: download or copy it again") from None


def missing_columns(source: Source, layout: Layout) -> list[str]:
    """Return the layout's names of the required columns that a source lacks."""
    return [column for column in layout.required if not source.find(column)]


def _text(path: Path, layout: Layout, member: str = "") -> Source:
    """Find the format of a text by its first line."""
    with open_text(path, member) as file:
        line = file.readline(_MAX_HEADER)
    source = Source(path, Kind.OTHER, member=member)
    if not line:
        return replace(source, note="it is empty")
    text = line.decode("utf-8-sig", errors="replace").strip()
    if not text.replace("\t", " ").isprintable() or _UNDECODED in text:
        return replace(source, note="it is not a text")
    blanks = "," not in text
    fields = text.split() if blanks else [field.strip() for field in next(csv.reader([text]))]
    if not all(_is_number(field) for field in fields):
        return _with_layout(replace(source, columns=tuple(fields), blanks=blanks), layout)
    if len(fields) == len(TEXT_COLUMNS):
        return replace(source, kind=Kind.TRAJECTORIES, columns=TEXT_COLUMNS, header=False, blanks=blanks)
    return replace(source, note=f"it has {len(fields)} columns and no header, NGSIM's text has {len(TEXT_COLUMNS)}")


def _with_layout(source: Source, expected: Layout) -> Source:
    """Find the layout of a file by its columns."""
    if _EPISODES.issubset(source.columns):
        return replace(source, kind=Kind.EPISODES)
    if source.find("t_rel") and not source.find("Frame_ID"):
        return replace(source, kind=Kind.NO_CLOCK, note="its cars stand on no common clock (t_rel), they make no pairs")
    lacks = [(missing_columns(source, layout), layout) for layout in (expected, OWN)]
    missing, layout = min(lacks, key=lambda one: len(one[0]))
    if len(missing) <= MAX_MISSING:
        return replace(source, kind=Kind.TRAJECTORIES, layout=layout)
    if len(missing) == len(layout.required):
        return replace(source, note=f"it has none of the columns of {'the site' if layout.of_site else 'NGSIM'}")
    return replace(source, note=f"it lacks the columns {', '.join(missing)}")


def _is_number(field: str) -> bool:
    try:
        float(field.replace(",", ""))
    except ValueError:
        return False
    return True

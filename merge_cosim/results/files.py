"""Files of a result folder: a damaged one is reported in one line, and files are replaced as a whole."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, Self

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError


class _Object(dict[str, Any]):
    """An object of a JSON file; a missing key is reported as a damaged file."""

    def of(self, file: Path) -> Self:
        """Name the file that it comes from."""
        self._file = file
        return self

    def __missing__(self, key: str) -> NoReturn:
        raise UserError(f"{self._file}: damaged (no '{key}'); run the sweep again")


def csv_rows(file: Path) -> list[dict[str, Any]]:
    """Rows of a CSV table as text; none where there is no such file."""
    if not file.is_file():
        return []
    with readable(file), file.open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
        if any(None in row or None in row.values() for row in rows):
            raise ValueError("a row is longer or shorter than the header")
    return [_Object(row).of(file) for row in rows]


def csv_table(file: Path, **options: Any) -> pd.DataFrame:
    """A CSV table, as `pandas.read_csv` reads it; empty where there is no such file."""
    with readable(file):
        return pd.read_csv(file, keep_default_na=False, **options) if file.is_file() else pd.DataFrame()


@contextmanager
def readable(file: Path) -> Iterator[None]:
    """Context for reading and parsing a text of the folder; an error in it is reported as a damaged file."""
    try:
        yield
    except FileNotFoundError:
        raise UserError(f"{file}: missing; run the sweep again") from None
    except (OSError, ValueError, OverflowError, RecursionError, csv.Error, pa.ArrowException) as error:
        raise UserError(f"{file}: damaged ({error}); run the sweep again") from None


def is_whole(file: Path) -> bool:
    """Whether a Parquet file is there and can be read to its end."""
    try:
        pq.read_table(file, page_checksum_verification=True)
    except (pa.ArrowException, OSError):
        return False
    return True


def require(file: Path, held: pa.Schema, expected: Iterable[pa.Field]) -> None:
    """Refuse a table in which a column is missing, is there twice or has another type.

    Raises:
        UserError: It does.
    """
    with readable(file):
        fields = [(field.name, field.type) for field in held]
    for column in expected:
        types = [kind for name, kind in fields if name == column.name]
        if types != [column.type] and not (types == [pa.large_string()] and column.type == pa.string()):
            raise UserError(f"{file}: damaged (no column '{column.name}' of type {column.type}); run the sweep again")


def read_table(file: Path, columns: Sequence[str] | None = None, filters: Any = None) -> pa.Table:
    """Read a Parquet file, or some of its columns, or the rows for which pyarrow's `filters` hold.

    Raises:
        UserError: It is missing or damaged.
    """
    with readable(file):
        return pq.read_table(file, columns=columns, filters=filters, page_checksum_verification=True)


def read_schema(file: Path) -> pa.Schema:
    """Names and types of a Parquet file's columns.

    Raises:
        UserError: It is missing or damaged.
    """
    with readable(file):
        return pq.read_schema(file)


def read_json(file: Path) -> Any:
    """Read a JSON file.

    Raises:
        UserError: It is missing or damaged, now or when a key is looked for that is not there.
    """
    with readable(file):
        return json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=lambda pairs: _Object(pairs).of(file))


def write_table(file: Path, rows: pa.Table) -> None:
    """Write a Parquet file, whole or not at all."""
    with replacing(file) as unfinished:
        pq.write_table(rows, unfinished, **parquet_options(rows.schema))


def parquet_options(schema: pa.Schema) -> dict[str, Any]:
    """How tables are written: texts by dictionary, as they repeat; numbers as they are, in half the time.

    With checksums, so that a changed byte is noticed when they are read.
    """
    texts = [column.name for column in schema if column.type == pa.string() and column.name != "case"]
    return {"compression": "zstd", "use_dictionary": texts, "write_page_checksum": True}


def write_text(file: Path, text: str) -> None:
    """Write a text, whole or not at all."""
    with replacing(file) as unfinished:
        unfinished.write(text.encode())


@contextmanager
def replacing(file: Path) -> Iterator[BinaryIO]:
    """A file to write to, which takes the name of `file` once all of it is on the disk."""
    with file.with_suffix(".tmp").open("wb") as unfinished:
        yield unfinished
        unfinished.flush()
        os.fsync(unfinished.fileno())
    os.replace(unfinished.name, file)

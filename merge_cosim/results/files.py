"""Files of a result folder: read with one clear line where one is damaged, written whole or not at all."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, Self

import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError


class _Object(dict[str, Any]):
    """An object of a JSON file: a key that is looked for and not there is a damage of the file."""

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
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def is_whole(file: Path) -> bool:
    """Whether a Parquet file is there and ends as it should."""
    try:
        pq.read_metadata(file)
    except (pa.ArrowInvalid, OSError):
        return False
    return True


def require(file: Path, held: pa.Schema, expected: Iterable[pa.Field]) -> None:
    """Refuse a table that lacks a column, has it twice, or with values of another type.

    Raises:
        UserError: It does.
    """
    for column in expected:
        types = [field.type for field in held if field.name == column.name]
        if types != [column.type] and not (types == [pa.large_string()] and column.type == pa.string()):
            raise UserError(f"{file}: damaged (no column '{column.name}' of type {column.type}); run the sweep again")


def read_table(file: Path, columns: Sequence[str] | None = None, filters: Any = None) -> pa.Table:
    """Read a Parquet file, or some of its columns, or the rows for which pyarrow's `filters` hold.

    Raises:
        UserError: It is missing or damaged.
    """
    with _damage(file):
        return pq.read_table(file, columns=columns, filters=filters)


def read_schema(file: Path) -> pa.Schema:
    """Names and types of a Parquet file's columns.

    Raises:
        UserError: It is missing or damaged.
    """
    with _damage(file):
        return pq.read_schema(file)


@contextmanager
def _damage(file: Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise UserError(f"{file}: missing; run the sweep again") from None
    except (pa.ArrowInvalid, OSError) as error:
        raise UserError(f"{file}: damaged ({error}); run the sweep again") from None


def read_json(file: Path) -> Any:
    """Read a JSON file.

    Raises:
        UserError: It is missing or damaged, now or when a key is looked for that is not there.
    """
    try:
        return json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=lambda pairs: _Object(pairs).of(file))
    except FileNotFoundError:
        raise UserError(f"{file}: missing; run the sweep again") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"{file}: damaged ({error}); run the sweep again") from None


def write_table(file: Path, rows: pa.Table) -> None:
    """Write a Parquet file, whole or not at all."""
    with replacing(file) as unfinished:
        pq.write_table(rows, unfinished, **parquet_options(rows.schema))


def parquet_options(schema: pa.Schema) -> dict[str, Any]:
    """How tables are written: texts by dictionary, as they repeat; numbers as they are, in half the time."""
    texts = [column.name for column in schema if column.type == pa.string() and column.name != "case"]
    return {"compression": "zstd", "use_dictionary": texts}


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

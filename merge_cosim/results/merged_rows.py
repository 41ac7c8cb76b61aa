"""The rows of a finished sweep: one sorted Parquet file or, of many rows, a folder of them, read in batches."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, groupby
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.results.files import parquet_options, read_schema, read_table, readable, replacing, require
from merge_cosim.results.parts import STRETCH_ROWS
from merge_cosim.results.schema import SCHEMA, SCHEMA_VERSION, VERSION_KEY

PART_ROWS = 1_000_000
"""A file with so many rows gets no more: `results.parquet` of more rows is a folder of such files."""
BATCH_ROWS = 100_000
"""Rows from which a batch of whole cases is full."""


class Rows:
    """The merged rows, in the order of `KEY`, at a path that is a file or a folder."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def write(self, stretches: Iterable[pa.Table]) -> None:
        """Write sorted stretches of rows that follow each other, as a file or, of more than `PART_ROWS` rows, a folder.

        No more than some stretches are held at a time.
        """
        unfinished = self._path.with_suffix(".tmp")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir()
        groups = _row_groups(stretches)
        files = 0
        while files == 0 or (first := next(groups, None)) is not None:
            begun = chain(() if files == 0 else (first,), groups)
            _write_groups(unfinished / f"part-{files:05d}.parquet", begun)
            files += 1
        _remove(self._path)
        if files == 1:
            os.replace(unfinished / "part-00000.parquet", self._path)
            unfinished.rmdir()
        else:
            os.replace(unfinished, self._path)

    def groups(self) -> list[tuple[str, str]]:
        """The scenarios and variations of the merged file, in its order."""
        return sorted({_group_of(file, number) for file, number in self.row_groups()})

    def batches(self, scenario: str, variation: str, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
        """The merged rows of one scenario and variation, in batches of whole cases; all columns, or `case` and some."""
        own = (one for one in self.row_groups() if _group_of(*one) == (scenario, variation))
        yield from self._in_whole_cases(own, columns)

    def all_batches(self, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
        """All merged rows in their order, in batches of whole cases; see `batches`.

        Raises:
            UserError: They are damaged.
        """
        for _, groups in groupby(self.row_groups(), key=lambda one: _group_of(*one)):
            yield from self._in_whole_cases(groups, columns)

    def _in_whole_cases(
        self, groups: Iterable[tuple[pq.ParquetFile, int]], columns: Sequence[str] | None
    ) -> Iterator[pa.Table]:
        wanted = None if columns is None else [*dict.fromkeys(("case", *columns))]
        held: list[pa.Table] = []
        for file, number in groups:
            with readable(self._path):
                held.append(file.read_row_group(number, columns=wanted))
            if sum(map(len, held)) >= BATCH_ROWS:
                rows = pa.concat_tables(held)
                whole = pc.not_equal(rows["case"], rows["case"][-1])  # the last case may go on in the next group
                if pc.any(whole).as_py():
                    yield rows.filter(whole)
                    held = [rows.filter(pc.invert(whole))]
        if held:
            yield pa.concat_tables(held)

    def __len__(self) -> int:
        with readable(self._path):
            return sum(pq.read_metadata(file).num_rows for file in self._files())

    def count(self, scenario: str, variation: str) -> int:
        """Number of merged rows of one scenario and variation."""
        groups = (
            (file, number) for file, number in self.row_groups() if _group_of(file, number) == (scenario, variation)
        )
        return sum(file.metadata.row_group(number).num_rows for file, number in groups)

    def row_groups(self) -> Iterator[tuple[pq.ParquetFile, int]]:
        """The groups of rows of the merged files, in their order; each is of one scenario and variation."""
        for path in self._files():
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                for number in range(file.num_row_groups):
                    yield file, number

    def read(self, columns: Sequence[str] | None = None) -> pa.Table:
        """All rows, or some columns of them."""
        return read_table(self._path, columns)

    def check(self) -> None:
        """Check that the rows are there and of this version, without reading them.

        Raises:
            UserError: There are none, or another version wrote them.
        """
        if not self._path.exists():
            raise UserError(f"{self._path}: no results here; run a sweep first")
        for one in self._files():
            held = read_schema(one)
            version = (held.metadata or {}).get(VERSION_KEY, b"none").decode()
            if version != SCHEMA_VERSION:
                raise UserError(
                    f"{self._path}: result schema {version}, expected {SCHEMA_VERSION}; run the sweep again"
                )
            require(one, held, SCHEMA)

    def _files(self) -> list[Path]:
        return sorted(self._path.glob("*.parquet")) if self._path.is_dir() else [self._path]


def _row_groups(stretches: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """Sorted rows in groups of `STRETCH_ROWS`, none of two scenarios or variations: however they were parted before."""
    for _, of_one in groupby(stretches, key=lambda rows: (rows["scenario"][0], rows["variation"][0])):
        held = SCHEMA.empty_table()
        for rows in of_one:
            held = pa.concat_tables([held, rows]).combine_chunks()
            while len(held) > STRETCH_ROWS:
                yield held[:STRETCH_ROWS]
                held = held[STRETCH_ROWS:]
        yield held


def _write_groups(file: Path, groups: Iterable[pa.Table]) -> None:
    """Write groups of rows to a file until it has `PART_ROWS` rows, or there are no more."""
    with (
        replacing(file) as unfinished,
        pq.ParquetWriter(unfinished, SCHEMA, **parquet_options(SCHEMA)) as writer,
    ):
        written = 0
        for rows in groups:
            writer.write_table(rows, row_group_size=len(rows))
            written += len(rows)
            if written >= PART_ROWS:
                break


def _group_of(file: pq.ParquetFile, number: int) -> tuple[str, str]:
    """Scenario and variation of a group of rows."""
    first = file.read_row_group(number, columns=["scenario", "variation"])[:1].to_pylist()[0]
    return first["scenario"], first["variation"]


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)

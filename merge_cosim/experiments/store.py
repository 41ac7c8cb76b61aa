"""A result folder: parts while a sweep runs, one sorted file, a summary and a manifest when it is done."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.errors import UserError
from merge_cosim.experiments.outcome import KEY, SCHEMA, SCHEMA_VERSION

RESULTS, SUMMARY_CSV, SUMMARY_JSON, MANIFEST, TRACES = (
    "results.parquet",
    "summary.csv",
    "summary.json",
    "manifest.json",
    "traces.parquet",
)


class ResultFolder:
    """The folder that a sweep writes to and a report reads from."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._parts = path / "parts"
        self._plan = self._parts / "plan.json"

    def begin(self, plan: dict[str, Any], resume: bool) -> None:
        """Make ready for a sweep; parts of an interrupted one are kept if it was the same and is to be resumed.

        Raises:
            UserError: There are parts and nothing says what to do with them, or they belong to another sweep.
        """
        if self.path.exists() and not self.path.is_dir():
            raise UserError(f"{self.path}: is a file; --out names a folder")
        if self._plan.is_file():
            if not resume:
                raise UserError(
                    f"{self.path}: holds an interrupted sweep; add --resume to finish it, or choose another --out"
                )
            before = json.loads(self._plan.read_text(encoding="utf-8"))
            changed = sorted(key for key in plan if plan[key] != before.get(key))
            if changed:
                raise UserError(
                    f"{self.path}: the interrupted sweep was another one ({', '.join(changed)} changed); "
                    f"repeat its command with --resume, or choose another --out"
                )
        self._parts.mkdir(parents=True, exist_ok=True)
        _write_text(self._plan, json.dumps(plan, indent=1))

    def done(self) -> set[str]:
        """Names of the batches whose parts are there."""
        return {file.stem for file in self._parts.glob("*.parquet")}

    def add(self, name: str, rows: pa.Table) -> None:
        """Store one batch's rows; after this they survive anything."""
        _write_table(self._parts / f"{name}.parquet", rows)

    def merge(self, more: Iterable[pa.Table] = ()) -> pa.Table:
        """Join all parts, and rows that the statistics made, into one sorted file; the parts go with `finish`."""
        parts = [pq.read_table(file, schema=SCHEMA) for file in sorted(self._parts.glob("*.parquet"))]
        rows = pa.concat_tables([*parts, *more]).sort_by(KEY)
        rows = rows.replace_schema_metadata(SCHEMA.metadata)
        _write_table(self.path / RESULTS, rows)
        return rows

    def part_rows(self) -> pa.Table:
        """All rows stored so far."""
        parts = [pq.read_table(file, schema=SCHEMA) for file in sorted(self._parts.glob("*.parquet"))]
        return pa.concat_tables(parts)

    def write_traces(self, records: pa.Table) -> None:
        """Write the cycle-by-cycle records of the telling cases."""
        _write_table(self.path / TRACES, records)

    def traces(self) -> pa.Table:
        """Read them: scenario, case, method and one row per cycle."""
        return pq.read_table(self.path / TRACES)

    def write_json(self, name: str, document: Any) -> None:
        """Write one JSON file of the folder."""
        _write_text(self.path / name, json.dumps(document, indent=1, allow_nan=False) + "\n")

    def finish(self) -> None:
        """Take the parts away, once everything is written."""
        for file in [*self._parts.glob("*.parquet"), self._plan]:
            file.unlink()
        self._parts.rmdir()

    def results(self) -> pa.Table:
        """Read the rows of a finished sweep.

        Raises:
            UserError: There are none, or another version wrote them.
        """
        file = self.path / RESULTS
        if not file.is_file():
            hint = "the sweep was interrupted; finish it with --resume" if self._plan.is_file() else "run a sweep first"
            raise UserError(f"{file}: no results here; {hint}")
        try:
            rows = pq.read_table(file)
        except pa.ArrowInvalid as error:
            raise UserError(f"{file}: not a Parquet file ({error})") from None
        version = (rows.schema.metadata or {}).get(b"merge_cosim_schema", b"none").decode()
        if version != SCHEMA_VERSION:
            raise UserError(f"{file}: result schema {version}, expected {SCHEMA_VERSION}; run the sweep again")
        return rows

    def read_json(self, name: str) -> Any:
        """Read one JSON file of the folder.

        Raises:
            UserError: It is missing.
        """
        file = self.path / name
        if not file.is_file():
            raise UserError(f"{file}: missing; run the sweep again")
        return json.loads(file.read_text(encoding="utf-8"))


def _write_table(file: Path, rows: pa.Table) -> None:
    unfinished = file.with_suffix(".tmp")
    pq.write_table(rows, unfinished, compression="zstd")
    os.replace(unfinished, file)


def _write_text(file: Path, text: str) -> None:
    unfinished = file.with_suffix(".tmp")
    unfinished.write_text(text, encoding="utf-8")
    os.replace(unfinished, file)

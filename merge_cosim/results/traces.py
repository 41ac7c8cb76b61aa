"""The cycle-by-cycle records of a result folder: collected piece by piece, joined to one file, read by case."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.results.files import read_schema, read_table, replacing, require, write_table
from merge_cosim.scoring.tracks import RECORDED
from merge_cosim.simulation.recording import trace_of

TRACES = "traces.parquet"
_TRACE = [
    *(pa.field(name, pa.string()) for name in ("scenario", "case", "method")),
    *(pa.field(name, pa.float64()) for name in trace_of(np.zeros((RECORDED, 1)), (), 0.0)),
]
"""The columns that every record has."""

NO_RECORDS = pd.DataFrame({name: pd.Series(dtype=str) for name in ("scenario", "case", "method")})
"""No record, with the columns that come first."""


class TraceFile:
    """The records of a result folder: pieces while they are made, `traces.parquet` afterwards."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / TRACES
        self._pieces = folder / "records"

    def begin(self, keep: bool) -> None:
        """Make ready for `add`; `keep` the traces that are there."""
        for file in self._pieces.glob("*.parquet"):  # of a sweep that was interrupted
            file.unlink()
        if keep:
            self.add("+", self.read())  # first by name

    def add(self, name: str, records: pa.Table) -> None:
        """Keep records for `join`, which takes them in the order of their names."""
        self._pieces.mkdir(exist_ok=True)
        write_table(self._pieces / f"{name}.parquet", records)

    def join(self) -> None:
        """Join the pieces to one file, holding no more than one at a time."""
        files = sorted(self._pieces.glob("*.parquet"))
        schema = pa.unify_schemas([pa.Schema.from_pandas(NO_RECORDS), *map(pq.read_schema, files)])
        schema = schema.remove_metadata()
        with (
            replacing(self._file) as unfinished,
            pq.ParquetWriter(unfinished, schema, compression="zstd", write_page_checksum=True) as writer,
        ):
            for file in files:
                writer.write_table(pq.read_table(file, schema=schema))
        for file in files:
            file.unlink()
        if files:
            self._pieces.rmdir()

    def read(self, cases: Iterable[tuple[str, str]] | None = None) -> pa.Table:
        """Read the records: scenario, case, method and one row per cycle.

        Args:
            cases: Scenario and case of those that are wanted; all, if not given.

        Raises:
            UserError: They are missing or damaged.
        """
        wanted: dict[str, list[str]] = {}
        for scenario, case in cases or ():
            wanted.setdefault(scenario, []).append(case)
        which = [[("scenario", "=", scenario), ("case", "in", names)] for scenario, names in wanted.items()]
        self._check()
        return read_table(self._file, filters=which or None)

    def _check(self) -> None:
        held = read_schema(self._file)
        if len(held) > len(NO_RECORDS.columns):  # a sweep of living traffic may have no record
            require(self._file, held, _TRACE)

    def recorded(self) -> pd.DataFrame:
        """Scenario, case and method of every record, in their order, with its number of cycles."""
        self._check()
        names = NO_RECORDS.columns.tolist()
        rows = read_table(self._file, names).to_pandas()
        return rows.groupby(names, sort=False).size().rename("cycles").reset_index()

"""A result folder: rows, traces, a summary with tables beside it, and a manifest; parts while a sweep runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import refuse_file
from merge_cosim.results.files import csv_rows, csv_table, read_json, readable, write_text
from merge_cosim.results.invariants import is_checked, joined
from merge_cosim.results.merged_rows import Rows
from merge_cosim.results.parts import BEFORE, Parts, with_facts
from merge_cosim.results.schema import KEY, SCHEMA
from merge_cosim.results.traces import TraceFile

SCENES_CSV, TRAFFIC_CSV, NOTES_CSV = "scenes.csv", "traffic.csv", "notes.csv"
STRATA_CSV, BELIEF_CSV, CALIBRATION_CSV = "strata.csv", "belief.csv", "calibration.csv"
ENSEMBLE_CSV, RIVALS_CSV = "ensemble.csv", "rivals.csv"
RESULTS, SUMMARY_CSV, SUMMARY_JSON, MANIFEST = "results.parquet", "summary.csv", "summary.json", "manifest.json"
TEXTS = dict.fromkeys(("scenario", "variation", "site", "source", "method", "model"), str) | {"against": str | None}
"""Columns of the summary that are texts; all others are numbers."""
OF_SCENE = ("scenario", "variation", "method", "scene")
"""What names a scene in the tables of scenes."""


class ResultFolder:
    """The folder that a sweep writes to and a report reads from.

    Attributes:
        path: Where it is.
        parts: What the chunks of a sweep gave that is not finished.
        rows: The rows of a finished sweep.
        traces: The cycle-by-cycle records.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.parts = Parts(path / "parts")
        self.rows = Rows(path / RESULTS)
        self.traces = TraceFile(path)

    def begin(self, plan: dict[str, Any], resume: bool = False, overwrite: bool = False) -> None:
        """Make ready for a sweep; parts of an interrupted one are kept if it was the same and is to be resumed.

        Args:
            plan: The identity of the sweep.
            resume: Go on with an unfinished one.
            overwrite: Replace a finished one and, without `resume`, an unfinished one.

        Raises:
            UserError: There is a sweep and neither option is set, or the sweep to resume is another one.
        """
        refuse_file(self.path)
        if self.parts.begun:
            if not (resume or overwrite):
                raise UserError(
                    f"{self.path}: holds an unfinished sweep; if that runs no more, add --resume to finish it or "
                    f"--overwrite to replace it, or choose another --out"
                )
            changed = _changed(plan, self.parts.plan()) if resume else []
            if changed:
                raise UserError(
                    f"{self.path}: the interrupted sweep was another one ({', '.join(changed)} changed); "
                    f"repeat its command with --resume, or choose another --out"
                )
        elif (self.path / MANIFEST).is_file() and not overwrite:
            if resume:
                changed = _changed(plan, self.read_json(MANIFEST))
                raise UserError(
                    f"{self.path}: holds a finished sweep, which was another one ({', '.join(changed)} changed); "
                    f"--overwrite replaces it, or choose another --out"
                )
            raise UserError(
                f"{self.path}: holds a finished sweep; --overwrite replaces it, --add adds to it, --resume keeps it; "
                f"or choose another --out"
            )
        if not (resume and self.parts.begun):
            self.parts.empty()
        self.parts.begin(plan)

    def reopen(self, plan: dict[str, Any], drop: str) -> None:
        """Make ready for adding to a finished sweep: its rows, without those of `drop`, and its scenes become parts.

        Raises:
            UserError: The folder holds no finished sweep, or something else was being done with it.
        """
        if self.parts.begun:
            changed = _changed(plan, self.parts.plan())
            if changed:
                raise UserError(
                    f"{self.path}: holds an unfinished sweep, which is another one ({', '.join(changed)} changed); "
                    f"finish it first, by its own command"
                )
            return
        self.results(["case"])
        self.parts.empty()
        self.parts.add(f"{BEFORE}-scenes", with_facts(SCHEMA.empty_table(), self._scene_facts(), self.invariants()))
        for number, (file, group) in enumerate(self.rows.row_groups()):
            rows = file.read_row_group(group)
            self.parts.add(f"{BEFORE}-{number:05d}", rows.filter(pc.not_equal(rows["method"], drop)))
        self.parts.begin(plan)

    def holds(self, plan: dict[str, Any]) -> bool:
        """Whether a finished sweep of this plan is here."""
        if self.parts.begun or not (self.path / MANIFEST).is_file():
            return False
        return not _changed(plan, self.read_json(MANIFEST))

    def merge(self, more: Callable[[pa.Table], pa.Table] | None = None) -> None:
        """Join all parts in the order of `KEY`, holding no more than some parts at a time; they stay until `finish`.

        `more` makes further rows from the rows of a stretch of cases, of which it gets all methods.
        """
        self.rows.write(_completed(rows, more) for rows in self.parts.stretches())

    def invariants(self) -> dict[str, Any]:
        """What the invariants of a finished sweep came to.

        Raises:
            UserError: The manifest is damaged.
        """
        found: dict[str, Any] = self.read_json(MANIFEST).get("invariants") or joined(())
        with readable(self.path / MANIFEST):
            if not is_checked(found):
                raise ValueError("invariants: no counts with a first case each")
        return found

    def summary(self) -> list[dict[str, Any]]:
        """Rows of the finished sweep's summary.

        Raises:
            UserError: They are missing or damaged.
        """
        rows: list[dict[str, Any]] = self.read_json(SUMMARY_JSON)
        with readable(self.path / SUMMARY_JSON):
            if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
                raise ValueError("no list of rows")
            for row in rows:
                if row.keys() != rows[0].keys():
                    raise ValueError("rows of different columns")
                for name, value in row.items():
                    if not isinstance(value, TEXTS.get(name, int | float | None)):
                        raise ValueError(f"{name} is {value!r}")
        return rows

    def table(self, name: str) -> pd.DataFrame:
        """One of the folder's CSV tables; empty where there is none."""
        return csv_table(self.path / name, na_values=[""])

    def traffic(self) -> list[dict[str, Any]]:
        """Rows of the finished sweep's table of scenes; none where there were no scenes."""
        return csv_rows(self.path / TRAFFIC_CSV)

    def _scene_facts(self) -> list[dict[str, Any]]:
        """Facts of the scenes of a finished sweep, as `with_facts` takes them."""
        file = self.path / SCENES_CSV
        if not file.is_file():
            return []
        notes: dict[tuple[str, ...], list[list[str]]] = {}
        for note in csv_rows(self.path / NOTES_CSV):
            notes.setdefault(tuple(note[name] for name in OF_SCENE), []).append([note["event"], note["what"]])
        names = dict.fromkeys((*OF_SCENE, "model"), str)
        frame = pd.read_csv(file, dtype=names, keep_default_na=False, na_values={})  # names may be 'NA'
        numbers = frame.columns.difference([*names])
        frame[numbers] = frame[numbers].apply(pd.to_numeric)
        facts: list[dict[str, Any]] = json.loads(frame.to_json(orient="records", double_precision=15))
        return [fact | {"notes": notes.get(tuple(fact[name] for name in OF_SCENE), [])} for fact in facts]

    def write_json(self, name: str, document: Any) -> None:
        """Write one JSON file of the folder."""
        write_text(self.path / name, json.dumps(document, indent=1, allow_nan=False) + "\n")

    def results(self, columns: Sequence[str] | None = None) -> pa.Table:
        """Read the rows of a finished sweep, or some columns of them.

        Raises:
            UserError: There are none, a sweep into this folder is not finished, or another version wrote them.
        """
        self.check()
        return self.rows.read(columns)

    def check(self) -> None:
        """Check that the rows of a finished sweep are there and of this version, without reading them.

        Raises:
            UserError: See `results`.
        """
        if self.parts.begun:  # what else is here may be of an earlier sweep
            raise UserError(f"{self.path}: holds an unfinished sweep; if that runs no more, finish it with --resume")
        self.rows.check()

    def read_json(self, name: str) -> Any:
        """Read one JSON file of the folder.

        Raises:
            UserError: It is missing or damaged.
        """
        return read_json(self.path / name)


def _completed(rows: pa.Table, more: Callable[[pa.Table], pa.Table] | None) -> pa.Table:
    """Rows of whole cases with further rows that are made from them, sorted."""
    every = rows if more is None else pa.concat_tables([rows, more(rows)])
    return every.sort_by(KEY).replace_schema_metadata(SCHEMA.metadata)


def _changed(plan: dict[str, Any], before: dict[str, Any]) -> list[str]:
    """What differs between a plan and the one before."""
    return sorted(key for key, value in json.loads(json.dumps(plan)).items() if before.get(key) != value)

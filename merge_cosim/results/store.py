"""A result folder: parts while a sweep runs; afterwards one sorted file, a summary and a manifest."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.results.files import (
    csv_rows,
    csv_table,
    is_whole,
    parquet_options,
    read_json,
    read_schema,
    read_table,
    readable,
    replacing,
    require,
    write_table,
    write_text,
)
from merge_cosim.results.invariants import Checked, joined, lines
from merge_cosim.results.schema import KEY, SCHEMA, SCHEMA_VERSION, VERSION_KEY
from merge_cosim.scoring.tracks import RECORDED
from merge_cosim.simulation.recording import trace_of

SCENE_FACTS, INVARIANTS = b"merge_cosim_scenes", b"merge_cosim_invariants"
"""Metadata of a part: the facts of the scenes that its rows come from, and what its invariants came to (JSON)."""
SCENES_CSV, TRAFFIC_CSV, NOTES_CSV = "scenes.csv", "traffic.csv", "notes.csv"
STRATA_CSV, BELIEF_CSV, CALIBRATION_CSV = "strata.csv", "belief.csv", "calibration.csv"
ENSEMBLE_CSV, RIVALS_CSV = "ensemble.csv", "rivals.csv"
RESULTS, SUMMARY_CSV, SUMMARY_JSON, MANIFEST, TRACES = (
    "results.parquet",
    "summary.csv",
    "summary.json",
    "manifest.json",
    "traces.parquet",
)


OF_SCENE = ("scenario", "variation", "method", "scene")
"""What names a scene in the tables of scenes."""
BEFORE = "before"
"""The parts that hold what a reopened folder held begin so."""
_TRACE = [
    *(pa.field(name, pa.string()) for name in ("scenario", "case", "method")),
    *(pa.field(name, pa.float64()) for name in trace_of(np.zeros((RECORDED, 1)), (), 0.0)),
]
"""The columns that every record has."""

NO_RECORDS = pd.DataFrame({name: pd.Series(dtype=str) for name in ("scenario", "case", "method")})
"""No record, with the columns that come first."""
STRETCH_ROWS = 100_000
"""Rows that are sorted and written at a time; more where more cases lie between each other."""
PART_ROWS = 1_000_000
"""A file with so many rows gets no more: `results.parquet` of more rows is a folder of such files."""
BATCH_ROWS = 100_000
"""Rows from which a batch of whole cases is full."""


class _Part(NamedTuple):
    """A stored piece: its file, its scenario and variation, and the first of its cases by name."""

    file: Path
    group: tuple[str, str]
    first: str

    @classmethod
    def of(cls, file: Path) -> _Part:
        rows = pq.read_table(file, columns=["scenario", "variation", "case"])
        least = {name: pc.min(rows[name]).as_py() for name in rows.column_names}
        return cls(file, (least["scenario"], least["variation"]), least["case"])


class ResultFolder:
    """The folder that a sweep writes to and a report reads from."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._parts = path / "parts"
        self._plan = self._parts / "plan.json"
        self._records = path / "records"

    def begin(self, plan: dict[str, Any], resume: bool = False, overwrite: bool = False) -> None:
        """Make ready for a sweep; parts of an interrupted one are kept if it was the same and is to be resumed.

        Args:
            plan: The identity of the sweep.
            resume: Go on with an unfinished one.
            overwrite: Replace a finished one and, without `resume`, an unfinished one.

        Raises:
            UserError: There is a sweep and neither option is set, or the sweep to resume is another one.
        """
        if self.path.exists() and not self.path.is_dir():
            raise UserError(f"{self.path}: is a file; --out names a folder")
        if self._plan.is_file():
            if not (resume or overwrite):
                raise UserError(
                    f"{self.path}: holds an unfinished sweep; if that runs no more, add --resume to finish it or "
                    f"--overwrite to replace it, or choose another --out"
                )
            changed = _changed(plan, read_json(self._plan)) if resume else []
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
        if not (resume and self._plan.is_file()):
            for part in self._parts.glob("*.parquet"):  # of a sweep that is replaced
                part.unlink()
        self._parts.mkdir(parents=True, exist_ok=True)
        write_text(self._plan, json.dumps(plan, indent=1))

    def reopen(self, plan: dict[str, Any], drop: str) -> None:
        """Make ready for adding to a finished sweep: its rows and its facts of scenes become parts.

        Args:
            plan: The identity of the sweep with what is added.
            drop: A method whose rows are left out, as they are made anew from the others.

        Raises:
            UserError: The folder holds no finished sweep, or something else was being done with it.
        """
        if self._plan.is_file():
            changed = _changed(plan, read_json(self._plan))
            if changed:
                raise UserError(
                    f"{self.path}: holds an unfinished sweep, which is another one ({', '.join(changed)} changed); "
                    f"finish it first, by its own command"
                )
            return
        self.results(["case"])
        self._parts.mkdir(exist_ok=True)
        for part in self._parts.glob("*.parquet"):
            part.unlink()
        self.add(f"{BEFORE}-scenes", with_facts(SCHEMA.empty_table(), self._scene_facts(), self._invariants()))
        for number, (file, group) in enumerate(self._row_groups()):
            rows = file.read_row_group(group)
            self.add(f"{BEFORE}-{number:05d}", rows.filter(pc.not_equal(rows["method"], drop)))
        write_text(self._plan, json.dumps(plan, indent=1))

    def before(self, scenario: str, variation: str, columns: list[str]) -> pa.Table:
        """Of a reopened folder: the rows that it held of one scenario and variation."""
        which = [("scenario", "=", scenario), ("variation", "=", variation)]
        files = sorted(self._parts.glob(f"{BEFORE}-*.parquet"))
        return pa.concat_tables(
            pq.read_table(file, columns=columns, filters=which).replace_schema_metadata() for file in files
        )

    def holds(self, plan: dict[str, Any]) -> bool:
        """Whether a finished sweep of this plan is here."""
        if self._plan.is_file() or not (self.path / MANIFEST).is_file():
            return False
        return not _changed(plan, self.read_json(MANIFEST))

    def done(self) -> set[str]:
        """Names of the batches whose parts are there, and can be read."""
        return {file.stem for file in self._parts.glob("*.parquet") if is_whole(file)}

    def add(self, name: str, rows: pa.Table) -> None:
        """Store one batch's rows; from then on they are on the disk."""
        write_table(self._parts / f"{name}.parquet", rows)

    def merge(self, more: Callable[[pa.Table], pa.Table] | None = None) -> None:
        """Join all parts in the order of `KEY`, holding no more than some parts at a time.

        What comes of it is a file or, of more than `PART_ROWS` rows, a folder of files. The parts stay until `finish`.

        Args:
            more: Makes further rows from the rows of a stretch of cases, of which it gets all methods.
        """
        whole, unfinished = self.path / RESULTS, (self.path / RESULTS).with_suffix(".tmp")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir()
        groups = _row_groups(_completed(rows, more) for rows in self._stretches())
        files = 0
        while files == 0 or (first := next(groups, None)) is not None:
            begun = chain(() if files == 0 else (first,), groups)
            _write_groups(unfinished / f"part-{files:05d}.parquet", begun)
            files += 1
        _remove(whole)
        if files == 1:
            os.replace(unfinished / "part-00000.parquet", whole)
            unfinished.rmdir()
        else:
            os.replace(unfinished, whole)

    def _stretches(self) -> Iterator[pa.Table]:
        """All stored rows, scenario by scenario, in stretches of whole cases that follow each other by name."""
        files = (file for file in self._parts.glob("*.parquet") if pq.read_metadata(file).num_rows)
        parts = sorted((_Part.of(file) for file in files), key=lambda part: (part.group, part.first, part.file.name))
        for _, group in groupby(parts, key=lambda part: part.group):
            held: list[pa.Table] = []
            members = list(group)
            for part, after in zip(members, [*members[1:], None], strict=True):
                held.append(pq.read_table(part.file, schema=SCHEMA))
                if after is None:
                    yield pa.concat_tables(held)
                elif sum(map(len, held)) >= STRETCH_ROWS:
                    rows = pa.concat_tables(held)
                    whole = pc.less(rows["case"], after.first)  # no later part has a row of these cases
                    if pc.any(whole).as_py():
                        yield rows.filter(whole)
                        held = [rows.filter(pc.invert(whole))]

    def scenes(self) -> list[dict[str, Any]]:
        """Facts of the scenes that the stored parts come from, in their order."""
        return [fact for facts in self._of_parts(SCENE_FACTS) for fact in facts]

    def invariants(self) -> dict[str, Any]:
        """What the invariants of all stored parts came to."""
        return joined(self._of_parts(INVARIANTS))

    def _of_parts(self, key: bytes) -> Iterator[Any]:
        """What the metadata of the stored parts hold, in their order."""
        for file in sorted(self._parts.glob("*.parquet")):
            metadata = pq.read_schema(file).metadata or {}
            if key in metadata:
                yield json.loads(metadata[key])

    def _invariants(self) -> dict[str, Any]:
        """What the invariants of a finished sweep came to."""
        found: dict[str, Any] = self.read_json(MANIFEST).get("invariants") or joined(())
        return found

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

    def note_lines(self) -> list[str]:
        """Notes on the results: a line for each broken invariant, event in scenes, and model."""
        return [*lines(self._invariants()), *self._scene_notes(), *self._support_notes()]

    def _support_notes(self) -> list[str]:
        """How many cases begin where a model was not trained, a line per scenario, variation and model."""
        found: dict[tuple[str, ...], tuple[int, int]] = {}
        with readable(self.path / SUMMARY_CSV):
            for row in csv_rows(self.path / SUMMARY_CSV):
                outside = row.get("outside_support")
                if outside and float(outside):
                    key = tuple(row[name] for name in ("scenario", "variation", "site", "source", "model"))
                    found[key] = int(float(outside)), int(row["n"]) + int(row["censored"])
        return [
            f"model {key[-1]}: {outside:,} of {n:,} cases of {' '.join(filter(None, key[:2]))} begin at times to "
            f"arrival that it was not trained on (column in_support)"
            for key, (outside, n) in found.items()
        ]

    def _scene_notes(self) -> list[str]:
        events: dict[str, list[dict[str, Any]]] = {}
        for row in csv_rows(self.path / NOTES_CSV):
            events.setdefault(row["event"], []).append(row)
        return [
            f"{event.replace('_', ' ')}: {len(rows):,}, such as: {rows[0]['what']} ({rows[0]['scenario']}, "
            f"{rows[0]['method']}, scene {rows[0]['scene']}); all in {self.path / NOTES_CSV}"
            for event, rows in events.items()
        ]

    def groups(self) -> list[tuple[str, str]]:
        """The scenarios and variations of the merged file, in its order."""
        return sorted({_group_of(file, number) for file, number in self._row_groups()})

    def batches(self, scenario: str, variation: str, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
        """The merged rows of one scenario and variation, in batches of whole cases.

        Args:
            scenario: The scenario.
            variation: The variation.
            columns: Columns to read beside `case`; None for all.
        """
        wanted = None if columns is None else [*dict.fromkeys(("case", *columns))]
        held: list[pa.Table] = []
        for file, number in self._row_groups():
            if _group_of(file, number) != (scenario, variation):
                continue
            held.append(file.read_row_group(number, columns=wanted))
            if sum(map(len, held)) >= BATCH_ROWS:
                rows = pa.concat_tables(held)
                whole = pc.not_equal(rows["case"], rows["case"][-1])  # the last case may go on in the next group
                if pc.any(whole).as_py():
                    yield rows.filter(whole)
                    held = [rows.filter(pc.invert(whole))]
        if held:
            yield pa.concat_tables(held)

    def count(self, scenario: str, variation: str) -> int:
        """Number of merged rows of one scenario and variation."""
        groups = (
            (file, number) for file, number in self._row_groups() if _group_of(file, number) == (scenario, variation)
        )
        return sum(file.metadata.row_group(number).num_rows for file, number in groups)

    def _files(self) -> list[Path]:
        whole = self.path / RESULTS
        return sorted(whole.glob("*.parquet")) if whole.is_dir() else [whole]

    def _row_groups(self) -> Iterator[tuple[pq.ParquetFile, int]]:
        """The groups of rows of the merged files, in their order; each is of one scenario and variation."""
        for path in self._files():
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                for number in range(file.num_row_groups):
                    yield file, number

    def begin_traces(self, keep: bool) -> None:
        """Make ready for `add_records`; `keep` the traces that are there."""
        for file in self._records.glob("*.parquet"):  # of a sweep that was interrupted
            file.unlink()
        if keep:
            self.add_records("+", self.traces())  # first by name

    def add_records(self, name: str, records: pa.Table) -> None:
        """Keep cycle-by-cycle records for `write_traces`, which joins them in the order of their names."""
        self._records.mkdir(exist_ok=True)
        write_table(self._records / f"{name}.parquet", records)

    def write_traces(self) -> None:
        """Join the records to one file, holding no more than one piece at a time."""
        files = sorted(self._records.glob("*.parquet"))
        schema = pa.unify_schemas([pa.Schema.from_pandas(NO_RECORDS), *map(pq.read_schema, files)])
        schema = schema.remove_metadata()
        with (
            replacing(self.path / TRACES) as unfinished,
            pq.ParquetWriter(unfinished, schema, compression="zstd", write_page_checksum=True) as writer,
        ):
            for file in files:
                writer.write_table(pq.read_table(file, schema=schema))
        for file in files:
            file.unlink()
        if files:
            self._records.rmdir()

    def traces(self, cases: Iterable[tuple[str, str]] | None = None) -> pa.Table:
        """Read the cycle-by-cycle records: scenario, case, method and one row per cycle.

        Args:
            cases: Scenario and case of those that are wanted; all, if not given.

        Raises:
            UserError: They are missing or damaged.
        """
        file = self.path / TRACES
        wanted: dict[str, list[str]] = {}
        for scenario, case in cases or ():
            wanted.setdefault(scenario, []).append(case)
        which = [[("scenario", "=", scenario), ("case", "in", names)] for scenario, names in wanted.items()]
        self._check_traces()
        return read_table(file, filters=which or None)

    def _check_traces(self) -> None:
        file = self.path / TRACES
        held = read_schema(file)
        if len(held) > len(NO_RECORDS.columns):  # of living traffic alone there may be no record
            require(file, held, _TRACE)

    def recorded(self) -> pd.DataFrame:
        """Scenario, case and method of every record, in their order, with its number of cycles."""
        self._check_traces()
        names = NO_RECORDS.columns.tolist()
        rows = read_table(self.path / TRACES, names).to_pandas()
        return rows.groupby(names, sort=False).size().rename("cycles").reset_index()

    def write_json(self, name: str, document: Any) -> None:
        """Write one JSON file of the folder."""
        write_text(self.path / name, json.dumps(document, indent=1, allow_nan=False) + "\n")

    def finish(self) -> None:
        """Remove the parts, once everything is written."""
        for file in [*self._parts.glob("*.parquet"), self._plan]:
            file.unlink()
        self._parts.rmdir()

    def results(self, columns: Sequence[str] | None = None) -> pa.Table:
        """Read the rows of a finished sweep, or some columns of them.

        Raises:
            UserError: There are none, a sweep into this folder is not finished, or another version wrote them.
        """
        self.check()
        return read_table(self.path / RESULTS, columns)

    def check(self) -> None:
        """Check that the rows of a finished sweep are there and of this version, without reading them.

        Raises:
            UserError: See `results`.
        """
        file = self.path / RESULTS
        if self._plan.is_file():  # what else is here may be of an earlier sweep
            raise UserError(f"{self.path}: holds an unfinished sweep; if that runs no more, finish it with --resume")
        if not file.exists():
            raise UserError(f"{file}: no results here; run a sweep first")
        for one in self._files():
            held = read_schema(one)
            version = (held.metadata or {}).get(VERSION_KEY, b"none").decode()
            if version != SCHEMA_VERSION:
                raise UserError(f"{file}: result schema {version}, expected {SCHEMA_VERSION}; run the sweep again")
            require(one, held, SCHEMA)

    def read_json(self, name: str) -> Any:
        """Read one JSON file of the folder.

        Raises:
            UserError: It is missing or damaged.
        """
        return read_json(self.path / name)


def with_facts(rows: pa.Table, facts: list[dict[str, Any]], invariants: Checked) -> pa.Table:
    """Result rows with the facts of their scenes, and what their invariants came to, for `ResultFolder.add`."""
    own = {SCENE_FACTS: json.dumps(facts), INVARIANTS: json.dumps(invariants)}
    return rows.replace_schema_metadata({**(SCHEMA.metadata or {}), **own})


def _completed(rows: pa.Table, more: Callable[[pa.Table], pa.Table] | None) -> pa.Table:
    """Rows of whole cases with further rows that are made from them, sorted."""
    every = rows if more is None else pa.concat_tables([rows, more(rows)])
    return every.sort_by(KEY).replace_schema_metadata(SCHEMA.metadata)


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


def _changed(plan: dict[str, Any], before: dict[str, Any]) -> list[str]:
    """What differs between a plan and the one before."""
    return sorted(key for key, value in json.loads(json.dumps(plan)).items() if before.get(key) != value)

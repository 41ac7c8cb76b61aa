"""The parts of a sweep that is not finished: what each chunk gave, and the plan that the chunks belong to."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from merge_cosim.results.files import is_whole, read_json, write_table, write_text
from merge_cosim.results.invariants import Checked, joined
from merge_cosim.results.schema import SCHEMA

SCENE_FACTS, INVARIANTS = b"merge_cosim_scenes", b"merge_cosim_invariants"
"""Metadata of a part: the facts of the scenes that its rows come from, and what its invariants came to (JSON)."""
BEFORE = "before"
"""The parts that hold what a reopened folder held begin so."""
STRETCH_ROWS = 100_000
"""Rows that are sorted and written at a time; more where more cases lie between each other."""


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


class Parts:
    """The folder of the parts; it is there as long as the sweep is not finished."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._plan = path / "plan.json"

    @property
    def begun(self) -> bool:
        """Whether a sweep has begun and is not finished."""
        return self._plan.is_file()

    def plan(self) -> Any:
        """The identity of the sweep that has begun."""
        return read_json(self._plan)

    def empty(self) -> None:
        """Remove the parts of an earlier sweep; make the folder where there is none."""
        self._path.mkdir(parents=True, exist_ok=True)
        for part in self._path.glob("*.parquet"):
            part.unlink()

    def begin(self, plan: dict[str, Any]) -> None:
        """Store the identity of the sweep that the parts belong to."""
        self._path.mkdir(parents=True, exist_ok=True)
        write_text(self._plan, json.dumps(plan, indent=1))

    def finish(self) -> None:
        """Remove the parts, once everything is written."""
        for file in [*self._path.glob("*.parquet"), self._plan]:
            file.unlink()
        self._path.rmdir()

    def finish_if_empty(self) -> None:
        """The same where no part is stored; what held nothing but the parts goes, too."""
        if not any(self._path.glob("*.parquet")):
            with suppress(OSError):  # it is read-only, or something else is there
                self.finish()
                self._path.parent.rmdir()

    def done(self) -> set[str]:
        """Names of the batches whose parts are there, and can be read."""
        return {file.stem for file in self._path.glob("*.parquet") if is_whole(file)}

    def add(self, name: str, rows: pa.Table) -> None:
        """Store one batch's rows; from then on they are on the disk."""
        write_table(self._path / f"{name}.parquet", rows)

    def before(self, scenario: str, variation: str, columns: list[str]) -> pa.Table:
        """Of a reopened folder: the rows that it held of one scenario and variation."""
        which = [("scenario", "=", scenario), ("variation", "=", variation)]
        files = sorted(self._path.glob(f"{BEFORE}-*.parquet"))
        return pa.concat_tables(
            pq.read_table(file, columns=columns, filters=which).replace_schema_metadata() for file in files
        )

    def stretches(self) -> Iterator[pa.Table]:
        """All stored rows, scenario by scenario, in stretches of whole cases that follow each other by name."""
        files = (file for file in self._path.glob("*.parquet") if pq.read_metadata(file).num_rows)
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
        for file in sorted(self._path.glob("*.parquet")):
            metadata = pq.read_schema(file).metadata or {}
            if key in metadata:
                yield json.loads(metadata[key])


def with_facts(rows: pa.Table, facts: list[dict[str, Any]], invariants: Checked) -> pa.Table:
    """Result rows with the facts of their scenes, and what their invariants came to, for `Parts.add`."""
    own = {SCENE_FACTS: json.dumps(facts), INVARIANTS: json.dumps(invariants)}
    return rows.replace_schema_metadata({**(SCHEMA.metadata or {}), **own})

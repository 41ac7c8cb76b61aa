"""Rows of a result folder run again in SUMO, in fresh processes, and compared with what is stored."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import load_plugin
from merge_cosim.core.units import IntArray
from merge_cosim.results.agreement import agreement
from merge_cosim.results.store import MANIFEST, ResultFolder
from merge_cosim.scenarios.methods import ORACLE_BEST, Method
from merge_cosim.scenarios.scenario import Scenario
from merge_cosim.scenarios.sources import Table
from merge_cosim.simulation.worlds.traffic import TRAFFIC
from merge_cosim.sweeps.chunks import ChunkQueue, cut
from merge_cosim.sweeps.executors import executor_for
from merge_cosim.sweeps.identity import digest, digest_of, ramp_files, software
from merge_cosim.sweeps.plan import SweepRequest, tasks_of
from merge_cosim.sweeps.task import Task


@dataclass(frozen=True)
class Verification:
    """Result of running stored rows again.

    Attributes:
        path: The result folder.
        rows: Number of rows that were run again.
        stored: Number of rows in the folder.
        differences: A row per column in which values differ, see `results.agreement.agreement`.
        notes: What differs from when the folder was made, such as versions and ramps.
    """

    path: Path
    rows: int
    stored: int
    differences: pd.DataFrame
    notes: Sequence[str] = field(default=())

    @property
    def beyond(self) -> int:
        """Number of values that differ beyond the tolerance."""
        return int(self.differences["beyond"].sum())

    def __str__(self) -> str:
        begin = f"{self.path}: {self.rows:,} of {self.stored:,} rows run again in SUMO: "
        if self.beyond:
            columns = ", ".join(self.differences.loc[self.differences["beyond"] > 0, "column"])
            values = "value differs" if self.beyond == 1 else "values differ"
            return f"{begin}{self.beyond:,} {values} beyond the tolerance, in {columns}"
        if not len(self.differences):
            return f"{begin}every value is the same"
        worst = self.differences.sort_values("largest", kind="stable").iloc[-1]
        return (
            f"{begin}every decision and outcome is the same, measures within the tolerance (at most "
            f"{worst['largest']:.1e} apart, in {worst['column']})"
        )


def verify(
    folder: Path,
    share: float = 0.05,
    seed: int = 0,
    data: Path | None = None,
    model: str | None = None,
    plugins: Sequence[Path] = (),
    jobs: int = 1,
    tolerance: float | None = None,
) -> Verification:
    """Run a share of the rows of each scenario, variation and method again, at least one of each.

    Rows of the closed form and of SUMO are run in SUMO, `human` from the log; `oracle-best`, which is picked from
    others, is left out. Of living traffic whole scenes are run. The arguments are those of `Results.verify`.

    Raises:
        UserError: The folder holds no finished sweep, or its scenarios, data or models are missing.
    """
    if not 0 < share <= 1:
        raise UserError(f"share {share:g}: must be above 0 and at most 1")
    for plugin in plugins:
        load_plugin(plugin)
    results = ResultFolder(folder)
    rows = results.results().to_pandas()
    manifest = results.read_json(MANIFEST)
    request = SweepRequest(
        (), data=data, model=model, source=manifest.get("source"), seed=manifest["seed"], plugins=plugins, jobs=jobs
    )
    tasks: list[Task] = []
    stored: list[pd.DataFrame] = []
    rng = np.random.default_rng(seed)
    for task, of_task in _tasks(rows, manifest, request, folder):
        some = _some_scenes if task.cases.scenes else _some_pairs
        parts, expected = some(task, of_task, share, rng)
        tasks += parts
        stored.append(expected)
    queue = ChunkQueue(cut(tasks))
    with closing(executor_for(request, len(queue))) as executor:
        tables = [finished.rows for finished in executor.run(queue)]
    again = pa.concat_tables([table.replace_schema_metadata() for table in tables]).to_pandas()
    chosen = pd.concat(stored, ignore_index=True)
    ramps = {ramp: digest_of(ramp_files(ramp)) for ramp in manifest["ramps"]}
    notes = [*_changes("versions", manifest["versions"], software()), *_changes("ramps", manifest["ramps"], ramps)]
    return Verification(folder, len(chosen), len(rows), agreement(chosen, again, tolerance), notes)


def _tasks(
    rows: pd.DataFrame, manifest: Mapping[str, Any], request: SweepRequest, folder: Path
) -> Iterator[tuple[Task, pd.DataFrame]]:
    """The tasks of the sweep, made anew from the manifest, each with its stored rows."""
    loaded: dict[str, Encounters] = {}
    rows = rows[rows["method"] != ORACLE_BEST]
    for names, group in rows.groupby(["scenario", "variation", "method"]):
        name, variation, method = map(str, names)
        scenario = Scenario.model_validate_json(
            json.dumps(manifest["scenarios"][f"{name} {variation}".strip()]), strict=True
        )
        if isinstance(scenario.encounters, Table) and scenario.encounters.file is None:
            raise UserError(
                f"{folder}: the initial states of '{name}' came from a Python program and are not kept here"
            )
        own = Method.of(method, manifest["parameters"][f"{method} {variation}".strip()])
        models = sorted(set(group["model"]) - {""})
        one_model = replace(request, model=request.model or (models[0] if len(models) == 1 else None))
        wanted = set(zip(group["source"], group["model"], strict=True))
        for task in tasks_of(scenario, variation, [own], one_model, loaded):
            first, model = task.part(0, 1).cases.encounters, task.names["model"]
            source = TRAFFIC if first is None else str(first.source[0])
            if (source, model) not in wanted:
                continue
            if task.model and digest(task.model.to_json().encode()) != manifest["models"].get(model):
                raise UserError(f"model {model}: {folder} was made with another one; give its file by --model")
            wanted.remove((source, model))
            yield task, group[(group["source"] == source) & (group["model"] == model)]
        for source, model in sorted(wanted):
            with_model = f" and of model {model}" if model else ""
            raise UserError(
                f"scenario {name}: rows are of {source} pairs{with_model}, which are not here; give --data and --model"
            )


Some = tuple[list[Task], pd.DataFrame]
"""What to run, and the rows that are expected of it."""


def _some_pairs(task: Task, rows: pd.DataFrame, share: float, rng: np.random.Generator) -> Some:
    expected = rows.iloc[_drawn(len(rows), share, rng)]
    pairs = task.cases.encounters
    assert pairs is not None
    absent = sorted(set(expected["case"]) - set(pairs.case.tolist()))
    if absent:
        raise UserError(f"scenario {task.scenario.name}: has no case '{absent[0]}' here; are --data the same?")
    return [task.take(np.flatnonzero(np.isin(pairs.case, expected["case"].to_numpy(dtype=str))))], expected


def _some_scenes(task: Task, rows: pd.DataFrame, share: float, rng: np.random.Generator) -> Some:
    scenes = [task.part(number, number + 1) for number in _drawn(len(task), share, rng).tolist()]
    names = {scene.case(0) for scene in scenes}
    return scenes, rows[rows["case"].str.partition("/")[0].isin(names)]


def _drawn(count: int, share: float, rng: np.random.Generator) -> IntArray:
    return np.sort(rng.choice(count, max(1, round(share * count)), replace=False))


def _changes(what: str, then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    """A line for each entry that has changed."""
    for name in sorted({*then, *now}):
        if then.get(name) != now.get(name):
            yield f"{what}: {name} was {then.get(name, 'absent')}, is {now.get(name, 'absent')}"

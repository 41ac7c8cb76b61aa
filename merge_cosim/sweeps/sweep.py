"""A sweep: plan, run the chunks, store them as they come, and sum up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from merge_cosim.core.errors import UserError
from merge_cosim.results.statistics import Summary, belief, calibration, oracle_best
from merge_cosim.results.statistics.belief import COLUMNS as BELIEF_COLUMNS
from merge_cosim.results.statistics.comparison import reference_of
from merge_cosim.results.statistics.ensemble import ensemble, rivals
from merge_cosim.results.statistics.summary import COLUMNS
from merge_cosim.results.statistics.traffic import scene_tables
from merge_cosim.results.store import (
    BELIEF_CSV,
    CALIBRATION_CSV,
    ENSEMBLE_CSV,
    MANIFEST,
    RIVALS_CSV,
    STRATA_CSV,
    SUMMARY_CSV,
    SUMMARY_JSON,
    ResultFolder,
)
from merge_cosim.results.traces import NO_RECORDS
from merge_cosim.scenarios.methods import ORACLE_BEST
from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.adding import joined, missing
from merge_cosim.sweeps.chunks import Chunk, ChunkQueue, cut
from merge_cosim.sweeps.executors import Executor, executor_for
from merge_cosim.sweeps.forecast import LONG_S, forecast, seconds
from merge_cosim.sweeps.identity import identity
from merge_cosim.sweeps.plan import SweepRequest, plan, refuse_unsound_ramps
from merge_cosim.sweeps.single_timing import time_single_cases
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.traces import record
from merge_cosim.sweeps.traffic_cases import refuse_empty

__all__ = ["SweepRequest", "plan", "sweep"]

Progress = Callable[[int, int, str], None]
"""Called with the cases done, all cases and what is being run; before the first case, with what there is to run."""


@dataclass
class _Tally:
    """What the chunks of this run cost; those of an interrupted run before it are not in it."""

    effort: Effort = field(default_factory=Effort)
    by_method: dict[str, Effort] = field(default_factory=dict)

    def add(self, method: str, effort: Effort) -> None:
        self.effort.add(effort)
        self.by_method.setdefault(method, Effort()).add(effort)


@dataclass(frozen=True)
class _Earlier:
    """What is kept of the sweep that is added to.

    Attributes:
        recorded: Scenario, case and method of its traces.
        cycle_us: For each of its methods the time of one update per encounter in a full batch, and in a batch of one.
    """

    recorded: pd.DataFrame = field(default_factory=NO_RECORDS.copy)
    cycle_us: dict[str, tuple[float, float | None]] = field(default_factory=dict)

    @classmethod
    def of(cls, folder: ResultFolder) -> _Earlier:
        rows = folder.summary()
        times = {row["method"]: (row["cycle_us"], row["cycle_us_single"]) for row in rows if row["cycle_us"]}
        return cls(folder.traces.recorded()[NO_RECORDS.columns], times)


def sweep(
    request: SweepRequest,
    out: Path,
    resume: bool = False,
    overwrite: bool = False,
    add: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run a sweep and write its result folder; returns the manifest.

    Args:
        request: What to run.
        out: Result folder.
        resume: Finish an interrupted sweep; a finished one is left as it is.
        overwrite: Replace what the folder holds; with `resume`, a finished sweep of another request.
        add: Run what the finished sweep in the folder lacks; its own methods, if the request names none.
        progress: Called after every chunk.

    Raises:
        UserError: See `plan`, `adding.joined` and `ResultFolder.begin`.
    """
    begin = perf_counter()
    folder = ResultFolder(out)
    before: dict[str, Any] = folder.read_json(MANIFEST) if add else {}
    against = request.against
    if add:  # the method to compare with may be one of the folder's
        request = replace(request, methods=request.methods or before["methods"], against=None)
    tasks = every = plan(request)
    refuse_unsound_ramps(request, tasks)
    what = identity(request, tasks)
    earlier = _Earlier()
    if add:
        what = joined(before, what, against, out)
        reference_of(what["methods"], against)
        folder.reopen(what, ORACLE_BEST)
        earlier = _Earlier.of(folder)
        try:
            tasks = list(missing(tasks, folder))
        except UserError:
            folder.parts.finish()  # as it was
            raise
    elif resume and folder.holds(what):
        manifest: dict[str, Any] = folder.read_json(MANIFEST)
        return manifest
    else:
        folder.begin(what, resume, overwrite)
    planned = perf_counter()
    if progress and seconds(tasks, request.jobs) >= LONG_S:
        progress(0, sum(map(len, tasks)), forecast(tasks, request.jobs))
    chunks, done = list(cut(tasks)), folder.parts.done()
    queue = ChunkQueue(chunk for chunk in chunks if chunk.name not in done)
    try:
        with closing(executor_for(request, len(queue))) as executor:
            tally = _run(executor, queue, chunks, folder, progress)
            ran = perf_counter()
            folder.merge(oracle_best if ORACLE_BEST in what["methods"] else None)
            folder.traces.begin(keep=add)
            record(request, every, folder, earlier.recorded, executor, progress)
    except Exception:
        folder.parts.finish_if_empty()  # nothing was run: there is nothing to resume
        raise
    scenes = folder.parts.scenes()
    _sum_up(tasks, folder, scenes, tally, reference_of(what["methods"], what["against"]), earlier)
    effort, run_s = tally.effort, ran - planned
    manifest = {
        **what,
        "left_out": before.get("left_out", {})
        | {task.scenario.name: list(task.left_out) for task in tasks if task.left_out},
        "command": {
            "jobs": request.jobs,
            "start": request.start,
            "dask": request.dask,
            "resumed": resume,
            "added": add,
            "traces": request.traces,
            "scenarios": sorted({*before.get("command", {}).get("scenarios", []), *_files(request)}),
            "data": str(request.data) if request.data else None,
            "plugins": {
                **before.get("command", {}).get("plugins", {}),
                **{plugin.name: str(plugin) for plugin in request.plugins},
            },
        },
        "invariants": folder.parts.invariants(),
        "wall_s": round(perf_counter() - begin, 3),
        "plan_s": round(planned - begin, 3),
        "run_s": round(run_s, 3),
        "store_s": round(perf_counter() - ran, 3),
        "loop_s": round(effort.wall_s, 3),
        "loop_cpu_s": round(effort.cpu_s, 3),
        "step_s": round(effort.step_s, 3),
        "vehicle_steps": effort.vehicle_steps,
        "vehicle_steps_per_s": round(effort.vehicle_steps / run_s) if effort.vehicle_steps else None,
        "ratio_to_bare_sumo": round(effort.wall_s / effort.step_s, 3) if effort.step_s else None,
        "real_time_factor": round(effort.scene_s / effort.wall_s, 2) if effort.scene_s else None,
        "worst_station_difference_m": max(effort.worst_difference_m, before.get("worst_station_difference_m", 0.0)),
    }
    folder.write_json(MANIFEST, manifest)
    folder.parts.finish()
    if all(task.cases.scenes for task in every):
        refuse_empty(scenes, f"{out}: {', '.join(dict.fromkeys(task.scenario.name for task in every))}")
    return manifest


def _files(request: SweepRequest) -> list[str]:
    """Names and files of the scenarios, where they came from such."""
    return [spec for spec in request.scenarios if isinstance(spec, str)]


def _run(
    executor: Executor, queue: ChunkQueue, chunks: Sequence[Chunk], folder: ResultFolder, progress: Progress | None
) -> _Tally:
    """Run and store the chunks of the queue, which are those of `chunks` that are not yet stored."""
    total = sum(map(len, chunks))
    finished = total - queue.cases
    tally = _Tally()
    with closing(executor.run(queue)) as outcomes:
        for chunk, rows, effort in outcomes:
            folder.parts.add(chunk.name, rows)
            queue.finished(chunk, effort)
            tally.add(chunk.whole.method.name, effort)
            finished += len(chunk)
            if progress:
                progress(finished, total, f"{chunk.whole.scenario.name} {chunk.whole.method.name}")
    return tally


def _sum_up(
    tasks: Sequence[Task],
    folder: ResultFolder,
    scenes: list[dict[str, Any]],
    tally: _Tally,
    against: str | None,
    earlier: _Earlier,
) -> None:
    """Write the summary and the tables beside it, one scenario and variation at a time."""
    single_us = time_single_cases(tasks)
    cycle_us = earlier.cycle_us | {
        name: (1e6 * effort.method_s / effort.encounter_cycles, single_us.get(name))
        for name, effort in tally.by_method.items()
        if effort.encounter_cycles
    }
    parts: dict[str, list[pd.DataFrame]] = {name: [] for name in (SUMMARY_CSV, STRATA_CSV, BELIEF_CSV, CALIBRATION_CSV)}
    for group in folder.rows.groups():
        sums = Summary(folder.rows.count(*group), against)
        for batch in folder.rows.batches(*group, COLUMNS):
            sums.add(batch.to_pandas())
        parts[SUMMARY_CSV].append(sums.table(cycle_us))
        parts[STRATA_CSV].append(sums.strata())
        labelled = _labelled(folder, *group)
        parts[BELIEF_CSV].append(belief(labelled))
        parts[CALIBRATION_CSV].append(calibration(labelled))
    tables = {name: pd.concat(found, ignore_index=True) if found else pd.DataFrame() for name, found in parts.items()}
    tables |= scene_tables(scenes)
    if len(tables[SUMMARY_CSV]):
        tables |= {ENSEMBLE_CSV: ensemble(tables[SUMMARY_CSV]), RIVALS_CSV: rivals(tables[SUMMARY_CSV])}
    for name, table in tables.items():
        (folder.path / name).unlink(missing_ok=True)
        if len(table):
            table.to_csv(folder.path / name, index=False)
    summary = tables[SUMMARY_CSV]
    folder.write_json(SUMMARY_JSON, summary.astype(object).where(summary.notna(), None).to_dict("records"))


def _labelled(folder: ResultFolder, scenario: str, variation: str) -> pd.DataFrame:
    """The rows of one scenario and variation whose cases have a label, with what beliefs are judged by."""
    batches = folder.rows.batches(scenario, variation, BELIEF_COLUMNS)
    return pa.concat_tables(rows.filter(pc.not_equal(rows["label"], "")) for rows in batches).to_pandas()

"""A single case: the same outcome as in a sweep, with every cycle recorded, or shown in sumo-gui."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.results.invariants import checked, lines
from merge_cosim.scenarios.sources import Traffic
from merge_cosim.simulation.loop import Everything
from merge_cosim.sumo.attach import Address
from merge_cosim.sumo.demand import write_traffic
from merge_cosim.sumo.outputs import SumoOutputs
from merge_cosim.sumo.routes import write_encounter
from merge_cosim.sumo.start import QUIT, connection_kept
from merge_cosim.sweeps.cases import RunOptions
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.traffic_cases import TrafficCases, refuse_empty
from merge_cosim.sweeps.worker_session import WorkerSession

NO_OUTPUTS = SumoOutputs()


def trace_case(
    task: Task,
    case: str,
    gui_delay: int | None = None,
    outputs: SumoOutputs = NO_OUTPUTS,
    attach: Address | None = None,
    stays: bool = True,
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Run a task of one case and return its result row and its record, one row per cycle.

    A case of living traffic is a scene, with its facts as the row, or an encounter in it (`SCENE/HOST/MERGING`).

    Raises:
        UserError: There is no such encounter; or the method is the log itself and a window, SUMO's outputs or a running
            SUMO are asked for; or SUMO does not run as it must.
    """
    asked = {"--gui": gui_delay is not None, "SUMO's outputs": outputs.wanted}
    for name in (name for name, given in asked.items() if given and attach is not None):
        raise UserError(f"{name}: not with --attach; the user who starts SUMO chooses the window and the outputs")
    for name in (name for name, given in (asked | {"--attach": attach is not None}).items() if given):
        if task.method.is_human:
            raise UserError(f"{name}: the method 'human' is the log itself and is not driven in SUMO; leave one out")
        if task.cases.world != "sumo":
            raise UserError(f"{name}: not with --world {task.cases.world}, which runs without SUMO; leave one out")
    if gui_delay is not None and "DISPLAY" not in os.environ and sys.platform.startswith("linux"):
        raise UserError("--gui: there is no display (DISPLAY is not set); leave it out, or use xvfb-run")
    quits = (QUIT,) if gui_delay is not None and not stays else ()
    options, session = RunOptions(gui_delay, (*outputs.prepare(), *quits), attach), WorkerSession(tiles=1)
    try:
        with connection_kept():
            ((run, facts),) = task.runs(session, options, traced=Everything())
    finally:
        session.close()
    outputs.check()
    table = task.rows(run)
    rows = {row["case"]: row for row in table.to_pylist()}
    if case in rows:
        broken = lines(checked(run, table))
        return rows[case] | ({"broken": broken} if broken else {}), run.traces[case].assign(case=case)
    if "/" in case:
        few = f" (such as {', '.join(list(rows)[:3])})" if rows else ""
        raise UserError(f"scenario {task.scenario.name}: no encounter '{case}' is scored under {task.method.name}{few}")
    refuse_empty(facts, f"scenario {task.scenario.name}")
    records = [trace.assign(case=name) for name, trace in run.traces.items()]
    return {**task.names, **facts[0]}, pd.concat(records or [pd.DataFrame()], ignore_index=True)


def case_alone(tasks: list[Task], case: str) -> Task:
    """The task of a single case.

    Raises:
        UserError: No task has such a case.
    """
    for task in tasks:
        try:
            number = task.cases.find(case)
        except UserError as error:
            refused = error
            continue
        return task.part(number, number + 1)
    raise UserError(f"scenario {tasks[0].scenario.name}: {refused}")


def trace_methods(request: SweepRequest, case: str) -> tuple[pd.DataFrame, dict[str, bool]]:
    """Run one case of one scenario under all of the request's methods.

    Returns:
        Records of all methods, one row per cycle, with the column `method`; and whether each failed.

    Raises:
        UserError: There is no such case.
    """
    records, failed = [], {}
    for task in plan(request):
        row, record = trace_case(case_alone([task], case), case)
        records.append(record.assign(method=task.method.name))
        failed[task.method.name] = bool(row["failed"])
    return pd.concat(records, ignore_index=True), failed


def export_case(request: SweepRequest, case: str, out: Path) -> Path:
    """Write one case of one scenario as SUMO files into a folder; returns the `.sumocfg`.

    The scenes of living traffic differ only by SUMO's seed.

    Raises:
        UserError: There is no such case, it is a SUMO configuration already, or its traffic drives on several copies of
            the ramp.
    """
    tasks = plan(request)
    task = tasks[0]
    if not isinstance(task.cases, TrafficCases):
        task = case_alone(tasks, case)
        assert task.cases.encounters is not None
        return write_encounter(out, task.ramp, task.cases.encounters, 0, task.scenario.host)
    traffic = task.cases.traffic
    if not isinstance(traffic, Traffic):
        raise UserError(f"{traffic.file}: this is a SUMO configuration already")
    if traffic.demand.copies > 1:
        raise UserError("export: the files of one ramp are written; leave out encounters.demand.copies")
    return write_traffic(out, traffic.demand, task.ramp)


def export_commonroad(request: SweepRequest, case: str, out: Path) -> Path:
    """Run one case of one scenario under one method and write it as a CommonRoad scenario; returns the file.

    Raises:
        UserError: There is no such case, the scenario's cases are scenes, or commonroad-io is not installed.
    """
    from merge_cosim.ramps.export.commonroad import need_library, write_commonroad

    need_library()
    tasks = plan(request)
    if tasks[0].cases.scenes:
        raise UserError(f"scenario {tasks[0].scenario.name}: --commonroad writes encounters of two cars, not scenes")
    task = case_alone(tasks, case)
    number = 1 + tasks[0].cases.find(case)
    encounters = task.cases.encounters
    assert encounters is not None
    _, record = trace_case(task, case)
    source = encounters.source[0]
    story = f"scenario {task.scenario.name} (source {source}), case {case}, host driven by {task.method.name}"
    return write_commonroad(out, task.ramp, encounters, record, number, story, task.scenario.host)

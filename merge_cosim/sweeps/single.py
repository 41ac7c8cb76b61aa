"""One case alone: the same outcome as in a sweep, with every cycle recorded, or shown in sumo-gui."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.view import view_options
from merge_cosim.simulation.worlds.logged import LoggedWorld
from merge_cosim.simulation.worlds.tiles import TiledWorld
from merge_cosim.sumo.attach import Address, AttachedSession
from merge_cosim.sumo.options import SumoOptions, delay_option
from merge_cosim.sumo.outputs import SumoOutputs
from merge_cosim.sumo.routes import write_encounter
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.start import TraciSession, connection_kept
from merge_cosim.sumo.tiles import tile_id
from merge_cosim.sweeps.full_scene_task import SceneReplay
from merge_cosim.sweeps.plan import SweepRequest, plan, plan_encounters
from merge_cosim.sweeps.scene_task import SceneBatch
from merge_cosim.sweeps.single_scene import export_scene, run_scene_alone
from merge_cosim.sweeps.task import Batch

NO_OUTPUTS = SumoOutputs()


def run_single(
    request: SweepRequest,
    case: str,
    gui_delay: int | None = None,
    trace: Path | None = None,
    outputs: SumoOutputs = NO_OUTPUTS,
    attach: Address | None = None,
) -> dict[str, Any]:
    """Run one case of one scenario under one method.

    Args:
        request: Names one scenario and one method.
        case: Name of the case.
        gui_delay: Milliseconds per step in sumo-gui; None runs without a window.
        trace: File for the cycle-by-cycle record (.csv or .parquet), or None.
        outputs: Files that SUMO is to write.
        attach: Drive in the SUMO that listens there, instead of one of our own.

    Returns:
        The result row.

    Raises:
        UserError: There is no such case, the trace's file name has another ending, or the method is the log itself
            and a window, SUMO's outputs or a running SUMO are asked for; or SUMO is not as it must be.
        OSError: A file cannot be written.
    """
    if trace is not None and trace.suffix not in (".csv", ".parquet"):
        raise UserError(f"{trace}: --trace writes .csv or .parquet")
    task = plan(request)[0]
    for name, given in (("--gui", gui_delay is not None), ("SUMO's outputs", outputs.wanted)):
        if attach is not None and given:
            raise UserError(f"{name}: not with --attach; whoever starts SUMO chooses the window and the outputs")
    if gui_delay is not None:
        _need_display()
    if isinstance(task, SceneBatch):
        row, record = run_scene_alone(task, case, gui_delay, outputs, attach)
    else:
        row, record = trace_case(_case_alone(plan_encounters(request), case), gui_delay, outputs, attach)
    if trace is not None:
        trace.parent.mkdir(parents=True, exist_ok=True)
        if trace.suffix == ".csv":
            record.to_csv(trace, index=False)
        else:
            record.to_parquet(trace, index=False)
    return row


def trace_case(
    batch: Batch, gui_delay: int | None = None, outputs: SumoOutputs = NO_OUTPUTS, attach: Address | None = None
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Run a batch of one and return its result row and its record, one row per cycle."""
    ramp = Ramp.load(batch.scenario.ramp)
    asked = {"--gui": gui_delay is not None, "SUMO's outputs": outputs.wanted, "--attach": attach is not None}
    wanted = [name for name, given in asked.items() if given]
    if wanted and batch.method.is_human:
        raise UserError(
            f"{wanted[0]}: the method 'human' is the log itself and is not driven in SUMO; leave one of them out"
        )
    world = _open_world(batch, ramp, gui_delay, outputs.prepare(), attach)
    try:
        with connection_kept():
            run = batch.simulate(world, ramp, traced=(0,))
    finally:
        world.close()
    return batch.rows(run, ramp).to_pylist()[0], pd.DataFrame(run.traces[0])


def _open_world(
    batch: Batch, ramp: Ramp, gui_delay: int | None, extra: tuple[str, ...], attach: Address | None
) -> TiledWorld | LoggedWorld:
    """SUMO for a batch of one."""
    if isinstance(batch, SceneReplay):
        if attach is not None:
            raise UserError("--attach: not with full_scene, which starts SUMO with a recording's cars; leave it out")
        return batch.open(ramp, gui_delay, extra)
    if attach is not None:
        return TiledWorld(ramp, 1, batch.seed, lambda options: AttachedSession(options, attach), tiled=False)
    if gui_delay is None:
        return TiledWorld(ramp, 1, batch.seed, extra=extra)
    shown = (*view_options(ramp.net.parent), *delay_option(gui_delay))
    world = TiledWorld(ramp, 1, batch.seed, _open_window, (*shown, *extra))
    world.session.follow(tile_id(0, "host"))
    return world


def trace_methods(request: SweepRequest, case: str) -> tuple[pd.DataFrame, dict[str, bool]]:
    """Run one case of one scenario under all of the request's methods.

    Returns:
        Records of all methods, one row per cycle, with the column `method`; and whether each failed.

    Raises:
        UserError: There is no such case.
    """
    records, failed = [], {}
    for batch in plan_encounters(request):
        row, record = trace_case(_case_alone([batch], case))
        records.append(record.assign(method=batch.method.name))
        failed[batch.method.name] = bool(row["failed"])
    return pd.concat(records, ignore_index=True), failed


def export_case(request: SweepRequest, case: str, out: Path) -> Path:
    """Write one case of one scenario as SUMO files into a folder; returns the `.sumocfg`."""
    task = plan(request)[0]
    if isinstance(task, SceneBatch):
        return export_scene(task, out)
    batch = _case_alone(plan_encounters(request), case)
    return write_encounter(out, Ramp.load(batch.scenario.ramp), batch.encounters, 0)


def export_commonroad(request: SweepRequest, case: str, out: Path) -> Path:
    """Run one case of one scenario under one method and write it as a CommonRoad scenario; returns the file.

    Raises:
        UserError: There is no such case, the scenario's cases are scenes, or commonroad-io is not installed.
    """
    from merge_cosim.ramps.export.commonroad import need_library, write_commonroad

    need_library()
    if isinstance(task := plan(request)[0], SceneBatch):
        raise UserError(f"scenario {task.scenario.name}: --commonroad writes encounters of two cars, not scenes")
    every = plan_encounters(request)
    batch = _case_alone(every, case)
    number = 1 + int(np.flatnonzero(every[0].encounters.case == case)[0])
    ramp = Ramp.load(batch.scenario.ramp)
    _, record = trace_case(batch)
    source = batch.encounters.source[0]
    story = f"scenario {batch.scenario.name} (source {source}), case {case}, host driven by {batch.method.name}"
    return write_commonroad(out, ramp, batch.encounters, record, number, story)


def _need_display() -> None:
    if "DISPLAY" not in os.environ and sys.platform.startswith("linux"):
        raise UserError("--gui: there is no display (DISPLAY is not set); leave it out, or use xvfb-run")


def _open_window(options: SumoOptions) -> Session:
    return TraciSession(options, gui=True)


def _case_alone(batches: Sequence[Batch], case: str) -> Batch:
    for batch in batches:
        found = np.flatnonzero(batch.encounters.case == case)
        if len(found):
            return batch.part(int(found[0]), int(found[0]) + 1)
    names = [str(name) for batch in batches for name in batch.encounters.case]
    few = did_you_mean(case, names) if len(names) <= 12 else f" (such as {names[0]}, {names[-1]})"
    raise UserError(f"scenario {batches[0].scenario.name}: no case '{case}'{few}")

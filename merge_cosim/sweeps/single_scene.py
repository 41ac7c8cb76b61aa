"""One scene alone, as in a sweep, with what was recorded of its meetings; or its files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import DT
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scenarios.sources import Traffic
from merge_cosim.simulation.worlds.meetings import RECORDED
from merge_cosim.simulation.worlds.traffic import SceneRun
from merge_cosim.sumo.attach import Address
from merge_cosim.sumo.demand import write_traffic
from merge_cosim.sumo.outputs import SumoOutputs
from merge_cosim.sweeps.scene_task import SceneBatch


def run_scene_alone(
    batch: SceneBatch, case: str, gui_delay: int | None, outputs: SumoOutputs, attach: Address | None
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Run a scene, or the one of a meeting.

    Args:
        batch: The scenes.
        case: A scene's name, or a meeting's (`SCENE/HOST/MERGING`).
        gui_delay: Milliseconds per step in sumo-gui; None runs without a window.
        outputs: Files that SUMO is to write.
        attach: Drive the hosts of the SUMO that listens there.

    Returns:
        The scene's facts, or the meeting's result row; and one row per cycle of its meetings, or of the one.

    Raises:
        UserError: There is no such scene or meeting.
    """
    name, _, meeting = case.partition("/")
    names = [batch.case(number) for number in range(len(batch))]
    if name not in names:
        raise UserError(f"scenario {batch.scenario.name}: no scene '{name}'{did_you_mean(name, names)}")
    with batch.scene(names.index(name)) as scene:
        run = batch.simulate(scene, gui_delay=gui_delay, extra=outputs.prepare(), attach=attach)
        record = _record(run, name)
        if not meeting:
            return batch.facts(run, scene), record
        rows = {row["case"]: row for row in batch.rows(run, scene).to_pylist()}
    if case not in rows:
        few = f" (such as {', '.join(list(rows)[:3])})" if rows else ""
        raise UserError(f"scenario {batch.scenario.name}: no meeting '{case}' is scored under {batch.method.name}{few}")
    return rows[case], record[record["case"] == case]


def export_scene(batch: SceneBatch, out: Path) -> Path:
    """Write the files of the scenario's scenes into a folder; returns the `.sumocfg`. They differ by SUMO's seed alone.

    Raises:
        UserError: The scenario is a configuration already, or its traffic drives on several copies of the ramp.
    """
    traffic = batch.scenario.encounters
    if not isinstance(traffic, Traffic):
        raise UserError(f"{batch.file}: this is a SUMO configuration already")
    if traffic.demand.copies > 1:
        raise UserError("export: the files of one ramp are written; leave out encounters.demand.copies")
    return write_traffic(out, traffic.demand, Ramp.load(batch.scenario.ramp))


def _record(run: SceneRun, scene: str) -> pd.DataFrame:
    """One row per meeting and cycle; its time is the one that SUMO's own files give to the same state."""
    parts = [pd.DataFrame(columns=["case", "time_s", *RECORDED])]
    for meeting in run.meetings:
        if meeting.states:
            part = pd.DataFrame(np.array(meeting.states), columns=list(RECORDED))
            part.insert(0, "time_s", (run.begin + (meeting.begin + np.arange(len(part))) * DT).round(9))
            part.insert(0, "case", f"{scene}/{meeting.host.name}/{meeting.merging.name}")
            parts.append(part)
    return pd.concat(parts, ignore_index=True)

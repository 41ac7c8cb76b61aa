"""Our loop beside simple alternatives, on the same cases with the same decisions."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.law import DistanceKeeping
from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.core.programs import run_program
from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession

SCENARIO, METHOD = "designed-2", "acc"
"""What is run: the laws of this scenario and method are the ones that the alternatives spell out."""
ALTERNATIVES = {"scalar": "scalar.py", "restart": "restart.py", "traci": "traci_socket.py"}
"""The alternatives and their scripts in `tools/bench`."""
LONGEST = 3600.0
"""Time limit of a script [s]: what it leaves behind, such as SUMO, would be waited for without end."""


@dataclass(frozen=True)
class Timing:
    """What one run of a loop took.

    Attributes:
        us_per_vehicle_step: Wall time per vehicle and step [us].
        cpu_us: Processor time per vehicle and step [us].
        failed: Outcome of each case, where the loop has our cases.
    """

    us_per_vehicle_step: float
    cpu_us: float
    failed: tuple[bool, ...] = ()


def compare(cases: int, sample: int, rounds: int) -> dict[str, Any]:
    """Time our loop on `cases` cases and the alternatives on an evenly spaced part of them, in turn, `rounds` times.

    Raises:
        UserError: An alternative's outcome differs from ours, so the times would not compare.
    """
    task = _task(cases)
    chosen = np.linspace(0, len(task) - 1, sample).round().astype(np.int64)
    efforts: list[Effort] = []
    timings: dict[str, list[Timing]] = {name: [] for name in ALTERNATIVES}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "task.json"
        file.write_text(json.dumps(_described(task.take(chosen))), encoding="utf-8")
        worker_session = WorkerSession()
        task.run(worker_session)  # to warm up
        for _ in range(rounds):
            ((run, _),) = task.runs(worker_session)
            efforts.append(run.effort)
            ours = tuple((run.columns["kind"][chosen] > 0).tolist())
            for name, script in ALTERNATIVES.items():
                timing = _run_script(script, file)
                if timing.failed != ours:
                    raise UserError(f"bench: {script} finds other failures than ours; its time does not compare")
                timings[name].append(timing)
        worker_session.close()
    own = median(1e6 * effort.wall_s / effort.vehicle_steps for effort in efforts)
    own_cpu = median(1e6 * effort.cpu_s / effort.vehicle_steps for effort in efforts)
    theirs = {name: median(one.us_per_vehicle_step for one in each) for name, each in timings.items()}
    their_cpu = {name: median(one.cpu_us for one in each) for name, each in timings.items()}
    return {
        "scenario": SCENARIO,
        "method": METHOD,
        "cases": len(task),
        "sample": sample,
        "vehicle_steps_per_s": round(1e6 / own),
        "us_per_vehicle_step": round(own, 3),
        "cpu_us_per_vehicle_step": round(own_cpu, 3),
        "ratio_to_bare_sumo": round(median(effort.wall_s / effort.step_s for effort in efforts), 3),
        "steps_and_calls_to_bare_sumo": round(median(1.0 + one.calls_s / one.step_s for one in efforts), 3),
        **{f"{name}_us_per_vehicle_step": round(time, 3) for name, time in theirs.items()},
        **{f"{name}_cpu_us_per_vehicle_step": round(time, 3) for name, time in their_cpu.items()},
        **{f"speedup_vs_{name}": round(time / own, 2) for name, time in theirs.items()},
        **{f"cpu_speedup_vs_{name}": round(time / own_cpu, 2) for name, time in their_cpu.items()},
    }


def _task(cases: int) -> Task:
    (task,) = plan(SweepRequest([SCENARIO], [METHOD]))
    n = len(task)
    return task.take(np.linspace(0, n - 1, min(cases, n)).round().astype(np.int64))


def _described(task: Task) -> dict[str, Any]:
    """What the scripts need to know, with the parameters that our own loop uses."""
    encounters, ramp = task.cases.encounters, task.ramp
    assert encounters is not None
    states = ("host_station", "host_speed", "merging_station", "merging_speed")
    columns = [getattr(encounters, name).tolist() for name in states]
    car = task.scenario.merging_car()
    assert isinstance(car, DistanceKeeping)
    rules = task.scenario.test
    return {
        "net": str(ramp.net),
        "main_route": list(ramp.main_route),
        "ramp_route": list(ramp.ramp_route),
        "road_length": -ramp.main[0].start,
        "length": float(encounters.host_length[0]),
        "speed_limit": task.setting.speed_limit,
        "horizon": rules.horizon_cycles,
        "time_out": rules.time_out_cycles,
        "host_law": asdict(Acc()),
        "merging_law": asdict(car),
        "cases": [dict(zip(states, case, strict=True)) for case in zip(*columns, strict=True)],
    }


def _run_script(script: str, task: Path) -> Timing:
    """Run a script of `tools/bench` in a process of its own, as libsumo holds one simulation per process."""
    file = shipped("tools/bench") / script
    if not file.is_file():
        raise UserError(f"{file}: missing; it comes with the source and with the wheel of merge-cosim")
    found = run_json([sys.executable, str(file), str(task)])
    steps = found["vehicle_steps"]
    return Timing(1e6 * found["wall_s"] / steps, 1e6 * found["cpu_s"] / steps, tuple(found["failed"]))


def run_json(command: Sequence[str]) -> Any:
    """Run a command that prints one JSON document.

    Raises:
        UserError: It fails; the line is its last one.
    """
    done = run_program(command, LONGEST, Path(command[1]))
    if done.returncode:
        message = done.stderr.decode(errors="replace").strip() or "no message"
        raise UserError(f"bench: {' '.join(command[1:3])} failed: {message.splitlines()[-1]}")
    return json.loads(done.stdout)

"""What pairs cost in SUMO and in the closed form, for methods of different weight."""

from __future__ import annotations

from statistics import median
from time import process_time
from typing import Any

import numpy as np

from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession

SCENARIO = "designed-2"
METHODS = ("acc", "slot", "pgm", "fg", "ipcb", "dbn-pf", "interactive")
WORLDS: tuple[WorldKind, ...] = ("sumo", "closed-form")


def world_costs(cases: int, rounds: int) -> list[dict[str, Any]]:
    """Processor time per vehicle and step [us] by method and world, scoring and result rows included.

    Args:
        cases: Cases that SUMO moves, evenly spaced; the closed form moves all.
        rounds: How often each is timed, in turns; the median counts.
    """
    tasks = {(world, task.method.name): _few(task, cases) for world in WORLDS for task in _tasks(world)}
    times: dict[tuple[WorldKind, str], list[tuple[float, float]]] = {kind: [] for kind in tasks}
    session = WorkerSession()
    for task in tasks.values():
        task.part(0, min(50, len(task))).run(session)  # to warm up
    for _ in range(rounds):
        for kind, task in tasks.items():
            times[kind].append(_cpu_us(task, session))
    session.close()
    cpu = {kind: median(one for one, _ in found) for kind, found in times.items()}
    return [
        {
            "method": name,
            "sumo_cpu_us": round(cpu["sumo", name], 3),
            "closed_form_cpu_us": round(cpu["closed-form", name], 3),
            "update_us": round(median(update for _, update in times["closed-form", name]), 3),
            "closed_form_is_cheaper_by": round(cpu["sumo", name] / cpu["closed-form", name], 1),
        }
        for name in METHODS
    ]


def _tasks(world: WorldKind) -> list[Task]:
    return plan(SweepRequest([SCENARIO], METHODS, world=world))


def _few(task: Task, cases: int) -> Task:
    if task.cases.world != "sumo":
        return task
    return task.take(np.linspace(0, len(task) - 1, min(cases, len(task))).round().astype(np.int64))


def _cpu_us(task: Task, session: WorkerSession) -> tuple[float, float]:
    """Processor time of everything, and wall time of only estimating and controlling."""
    begin, steps, method = process_time(), 0, 0.0
    for first in range(0, len(task), task.most):
        _, effort = task.part(first, min(first + task.most, len(task))).run(session)
        steps += effort.vehicle_steps
        method += effort.method_s
    return 1e6 * (process_time() - begin) / steps, 1e6 * method / steps

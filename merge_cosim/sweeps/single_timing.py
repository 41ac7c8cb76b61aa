"""A few cases of a sweep run one at a time, to time each method in a batch of one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession

SINGLE_CASES = 5
"""Most cases of each scenario that are run one at a time."""
ONE_IN = 50
"""One case, and another one for so many; otherwise a small sweep would spend most of its time here."""


def time_single_cases(tasks: Sequence[Task]) -> dict[str, float]:
    """Time of one update in a batch of one [us], by method.

    Living traffic is left out: its encounters cannot be run one at a time.
    """
    efforts: dict[str, Effort] = {}
    worker_session = WorkerSession(tiles=1)
    for task in tasks:
        if task.variation or task.cases.scenes:
            continue
        count = min(SINGLE_CASES, 1 + len(task) // ONE_IN, len(task))
        for run, _ in task.take(np.arange(count)).runs(worker_session):
            efforts.setdefault(task.method.name, Effort()).add(run.effort)
    worker_session.close()
    return {name: 1e6 * e.method_s / e.encounter_cycles for name, e in efforts.items() if e.encounter_cycles}

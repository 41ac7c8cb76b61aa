"""A few cases of a sweep run one at a time, to time each method in a batch of one."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing

import numpy as np

from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.chunks import ChunkQueue, cut
from merge_cosim.sweeps.executors import Executor
from merge_cosim.sweeps.task import Task

SINGLE_CASES = 5
"""Most cases of each scenario that are run one at a time."""
ONE_IN = 50
"""One case, and another one for so many; otherwise a small sweep would spend most of its time here."""


def time_single_cases(tasks: Sequence[Task], executor: Executor) -> dict[str, float]:
    """Time of one update in a batch of one [us], by method.

    Living traffic is left out: its encounters cannot be run one at a time.

    Args:
        tasks: What was run.
        executor: Where to run them.
    """
    few = (
        task.take(np.arange(min(SINGLE_CASES, 1 + len(task) // ONE_IN, len(task))))
        for task in tasks
        if not (task.variation or task.cases.scenes)
    )
    efforts: dict[str, Effort] = {}
    with closing(executor.run(ChunkQueue(cut(list(few), most=1)))) as outcomes:
        for chunk, _, effort in outcomes:
            efforts.setdefault(chunk.whole.method.name, Effort()).add(effort)
    return {name: 1e6 * e.method_s / e.encounter_cycles for name, e in efforts.items() if e.encounter_cycles}

"""A few cases of a sweep run one at a time: to time a method in a batch of one, and to record one case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd
import pyarrow as pa

from merge_cosim.results.store import ResultFolder
from merge_cosim.scenarios.methods import is_reference
from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession

SINGLE_CASES = 5
"""Cases run one at a time to time a method's update in a batch of one."""


_NO_RECORDS = pd.DataFrame({name: pd.Series(dtype=str) for name in ("scenario", "case", "method")})


def time_single_cases(
    tasks: Sequence[Task], results: ResultFolder, chosen: Mapping[str, str] | None = None
) -> tuple[dict[str, float], pa.Table]:
    """Run a few cases of each scenario and method one at a time, the illustrative one first and recorded.

    Living traffic is left out: its encounters cannot be run alone.

    Args:
        tasks: What was run.
        results: Its rows.
        chosen: The illustrative cases of some scenarios; those of the others are chosen here.

    Returns:
        Time of one update in a batch of one [us] by method, and the records of the illustrative cases.
    """
    illustrative = dict(chosen or {})
    efforts: dict[str, Effort] = {}
    records = [_NO_RECORDS]
    worker_session = WorkerSession(tiles=1)
    for task in tasks:
        if task.variation or task.cases.scenes:
            continue
        scenario = task.scenario.name
        if scenario not in illustrative:
            illustrative[scenario] = _illustrative_case(
                batch.to_pandas() for batch in results.batches(scenario, "", ["method", "failed", "distance_m"])
            )
        number = task.cases.number(illustrative[scenario])
        shown = [] if number is None else [number]
        others = [row for row in range(min(len(task), SINGLE_CASES)) if row != number]
        rows = np.array([*shown, *others][:SINGLE_CASES])
        name = task.case(int(rows[0]))
        for run, _ in task.take(rows).runs(worker_session, traced={name}):
            efforts.setdefault(task.method.name, Effort()).add(run.effort)
            records.append(run.traces[name].assign(scenario=scenario, case=name, method=task.method.name))
    worker_session.close()
    times = {name: 1e6 * e.method_s / e.encounter_cycles for name, e in efforts.items() if e.encounter_cycles}
    return times, pa.Table.from_pandas(pd.concat(records), preserve_index=False)


def _illustrative_case(batches: Iterable[pd.DataFrame]) -> str:
    """The case on which the methods differ most: in failing, then in where they are when the host arrives.

    References do not count, unless there is nothing else.
    """
    best: tuple[tuple[float, float], str] | None = None
    for rows in batches:
        methods = rows[~rows["method"].isin([name for name in rows["method"].unique() if is_reference(name)])]
        by_case = (methods if len(methods) else rows).groupby("case")
        failing = by_case["failed"].mean()
        spread = by_case["distance_m"].max() - by_case["distance_m"].min()
        order = pd.DataFrame({"split": failing * (1 - failing), "spread": spread.fillna(0.0)})
        first = order.sort_values(["split", "spread"], ascending=False, kind="stable").iloc[0]
        differ = float(first["split"]), float(first["spread"])
        if best is None or differ > best[0]:
            best = differ, str(first.name)
    assert best is not None  # a task has cases, and a case has rows
    return best[1]

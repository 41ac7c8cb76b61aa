"""Which cases of a sweep are recorded cycle by cycle, and their recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np
import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.results.store import ResultFolder
from merge_cosim.scenarios.methods import is_reference
from merge_cosim.sweeps.chunks import ChunkQueue, cut
from merge_cosim.sweeps.executors import Executor, InProcess, Processes, executor_for
from merge_cosim.sweeps.forecast import LONG_S, duration, seconds
from merge_cosim.sweeps.plan import SweepRequest
from merge_cosim.sweeps.task import Task

Traces: TypeAlias = Literal["all", "failed", "telling"] | int | None
"""Cases of each scenario that are recorded: all; those that fail under a method; those on which the methods disagree
(no more than `MOST_DISAGREEING`); a number of them, 0 for none, those of disagreement first. None: a few of
disagreement, and none of living traffic, whose scenes would have to be run again."""
MOST_DISAGREEING = 200
A_FEW, ONE_IN = 12, 50
"""Where nothing is asked for: one case, and one more of every `ONE_IN`, but no more than `A_FEW`."""


COLUMNS = ("method", "failed", "stuck", "distance_m")
"""Columns of the rows that the choice rests on, beside `case`."""


def parse_traces(text: str | int | None) -> Traces:
    """What `--traces` takes.

    Raises:
        UserError: It is none of that.
    """
    match text:
        case "all" | "failed" | "telling" | None:
            return text
    if str(text).isdecimal():
        return int(str(text))
    raise UserError(f"--traces {text}: give all, failed, telling, or a number of cases")


def record(
    request: SweepRequest,
    tasks: Sequence[Task],
    folder: ResultFolder,
    earlier: pd.DataFrame,
    executor: Executor,
    progress: Callable[[int, int, str], None] | None = None,
) -> None:
    """Run the chosen cases again and write their traces into a folder whose rows are merged.

    Args:
        request: What was asked for.
        tasks: All its tasks.
        folder: The folder.
        earlier: Scenario, case and method of the traces that it holds already and keeps.
        executor: What ran the cases; its processes, if it has some, go on with these.
        progress: Called with the state of the work, where it takes long.
    """
    again = list(_recorded(request.traces, tasks, folder, earlier))
    cost = seconds(again, request.jobs)
    report = progress if cost >= LONG_S else None
    total, done = sum(map(len, again)), 0
    if report:
        report(0, total, f"{total:,} runs to record: about {duration(cost)}")
    queue = ChunkQueue(cut(again))
    if not isinstance(executor, Processes):
        executor = executor_for(request, len(queue)) if report else InProcess()
    with closing(executor), closing(executor.run(queue)) as outcomes:
        for chunk, records, effort in outcomes:
            queue.finished(chunk, effort)
            folder.traces.add(chunk.name, records)
            done += len(chunk)
            if report:
                report(done, total, f"recording {chunk.whole.scenario.name} {chunk.whole.method.name}")
    folder.traces.join()


def _recorded(wanted: Traces, tasks: Sequence[Task], folder: ResultFolder, earlier: pd.DataFrame) -> Iterator[Task]:
    """The chosen cases as tasks, each case once per method: of several models under the first that was run on it."""
    done = set(earlier.itertuples(index=False, name=None))
    chosen: dict[str, list[str]] = {}
    for task in tasks:
        scenario, cases = task.scenario.name, task.cases
        if task.variation or (cases.scenes and wanted is None):
            continue
        if scenario not in chosen:
            before = earlier.loc[earlier["scenario"] == scenario, "case"].drop_duplicates().tolist()
            rows = (batch.to_pandas() for batch in folder.rows.batches(scenario, "", COLUMNS))
            new = [] if wanted == 0 or (before and wanted is None) else choose(rows, wanted)
            chosen[scenario] = list(dict.fromkeys([*before, *new]))
        places: dict[str, int] = {}
        for case in chosen[scenario]:
            place = None if (scenario, case, task.method.name) in done else cases.number(case)
            if place is not None:
                places[case] = place
        if not cases.scenes:
            if places:
                yield replace(task.take(np.array([*places.values()])), recorded=frozenset(places))
        else:
            for number in sorted({*places.values()}):
                here = frozenset(case for case, place in places.items() if place == number)
                yield replace(task.part(number, number + 1), recorded=here)
        done |= {(scenario, case, task.method.name) for case in places}


def choose(batches: Iterable[pd.DataFrame], wanted: Traces) -> list[str]:
    """Names of the cases to record, those of disagreement first.

    First come cases on which the methods disagree in failing or being stuck, evenly or not: one of each set of methods
    that do, then a second of each, and so on; in a set, the case first in which the methods' distances at the host's
    arrival differ most. References do not count, unless there is nothing else.

    Args:
        batches: Result rows of one scenario, in batches of whole cases: `case` and `COLUMNS`.
        wanted: Which of them.
    """
    most = wanted if isinstance(wanted, int) else {None: A_FEW, "telling": MOST_DISAGREEING}.get(wanted)
    ranked, count = pd.DataFrame(), 0
    for rows in batches:
        found = _by_case(rows)
        count += len(found)
        ranked = pd.concat([ranked, found]).sort_values(["split", "spread"], ascending=False, kind="stable")
        if most is not None:
            ranked = ranked.groupby("pattern", sort=False).head(most)
    if ranked.empty:
        return []
    ranked["turn"] = ranked.groupby("pattern").cumcount()
    ranked = ranked.sort_values(["agreed", "turn"], kind="stable")
    disagreeing = ranked[~ranked["agreed"]] if not ranked["agreed"].all() else ranked[:1]
    if wanted is None:
        chosen = disagreeing[: min(A_FEW, 1 + count // ONE_IN)]
    elif wanted == "telling":
        chosen = disagreeing[:most]
    else:
        chosen = ranked[ranked["failed"]] if wanted == "failed" else ranked[:most]
    return [str(case) for case in chosen.index]


def _by_case(rows: pd.DataFrame) -> pd.DataFrame:
    """How far the methods disagree on each case."""
    methods = rows[~rows["method"].isin([name for name in rows["method"].unique() if is_reference(name)])]
    own = methods if len(methods) else rows
    bad = own["failed"] | own["stuck"]
    own = own.assign(bad=bad, pattern=own["method"].where(bad, "")).sort_values("method", kind="stable")
    by_case = own.groupby("case")
    share = by_case["bad"].mean()
    spread = by_case["distance_m"].max() - by_case["distance_m"].min()
    return pd.DataFrame(
        {
            "agreed": (share == 0.0) | (share == 1.0),
            "split": share * (1 - share),
            "spread": spread.fillna(0.0),
            "failed": by_case["failed"].any(),
            "pattern": _patterns(own, by_case.size()),
        }
    )


def _patterns(own: pd.DataFrame, sizes: pd.Series) -> pd.Series:
    """The `pattern` of the rows of each case, joined."""
    patterns = pd.Series(np.char.multiply(" ", sizes.to_numpy() - 1), sizes.index, dtype=object)
    rows = own[own["case"].isin(own.loc[own["bad"], "case"])]  # the others are nothing but spaces
    joined: dict[str, str] = {}
    for case, pattern in zip(rows["case"].tolist(), rows["pattern"].tolist(), strict=True):
        joined[case] = f"{joined[case]} {pattern}" if case in joined else pattern
    patterns.loc[[*joined]] = [*joined.values()]
    return patterns

"""`merge_cosim.sweep`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from merge_cosim.api.progress import sweep_progress
from merge_cosim.api.request import Methods, Scenarios, request_of
from merge_cosim.api.results import Results
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.scenarios.encounters import SourceChoice
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.sweeps.plan import StartMethod
from merge_cosim.sweeps.sweep import sweep as run_sweep


def sweep(
    scenarios: Scenarios,
    methods: Methods = None,
    *,
    model: str | Path | IntentionModel | None = None,
    settings: Mapping[str, Any] | None = None,
    vary: Mapping[str, Iterable[Any]] | None = None,
    data: str | Path | None = None,
    source: SourceChoice | None = None,
    seed: int = 0,
    against: str | None = None,
    plugins: Sequence[str | Path] = (),
    jobs: int | None = None,
    start: StartMethod = "spawn",
    dask: str | None = None,
    world: WorldKind = "sumo",
    out: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    add: bool = False,
    traces: Literal["all", "failed", "telling"] | int | None = None,
    unchecked_ramp: bool = False,
    progress: bool = True,
) -> Results:
    """Run every case of some scenarios under some methods.

    Example:
        >>> import merge_cosim as mc
        >>> results = mc.sweep("designed-2", ["acc", "pgm"], out="out/first")  # doctest: +SKIP
        >>> results.summary()  # doctest: +SKIP

    Args:
        scenarios: A scenario or several: the name of a shipped one or of a family (`"shifted"` is every
            `"shifted-..."`), a scenario file, a `.sumocfg`, a `Scenario`, or `Encounters` (initial states of your own).
            A mapping gives them names.
        methods: Methods: a name (`"pgm"`, `"pgm+lqr"`), an estimator or its class, or a pair of an estimator and a
            controller. All that there are, if not given.
        model: Learned model: a file, the name of one that comes with the project, or an `IntentionModel`. None takes
            the one that goes with each scenario's source.
        settings: Values of scenario keys and of parameters, as `{"test.horizon": 5, "acc.headway": 1.2}`.
        vary: Values of keys or parameters that are tried one after the other, as `{"acc.headway": [1.0, 1.5]}`.
        data: Folder with NGSIM files; else `$MERGE_COSIM_DATA`, else `./data`.
        source: `"ngsim"` or `"surrogate"`: force real data or the surrogate.
        seed: Seed of SUMO and of every random stream.
        against: Method that the others are compared with on the same cases; `pgm`, if it is run.
        plugins: Python files with components of your own.
        jobs: Processes; one per core, if not given. The rows do not depend on it.
        start: How processes are started: `"spawn"`, `"forkserver"` or `"fork"`.
        dask: Address of a Dask scheduler to run on, or `"local"`.
        world: What moves the cars: `"sumo"`, or `"closed-form"` (`s' = s + v dt`, many times faster; pairs only).
        out: Result folder; a temporary one, kept as long as the returned object, if not given.
        resume: Finish an interrupted sweep in `out`; a finished one is read, not run again.
        overwrite: Replace the sweep that `out` holds, finished or not.
        add: Add methods, variations, scenarios or cases to the finished sweep in `out`, of the same settings; its rows
            are then those of one sweep of all. Without `methods`, those that it holds.
        traces: Cases of each scenario that are recorded cycle by cycle, to be watched in the report: `"all"`,
            `"failed"`, `"telling"` (the methods disagree; up to 200), or a number, those of disagreement
            first, 0 for none. A few of these, if not given. With `add` and nothing else new, traces are added to a
            finished sweep.
        unchecked_ramp: Run on a ramp that does not pass `ramp check`, too, which is refused otherwise.
        progress: Show how far the sweep is, on standard error.

    Returns:
        The results: rows, summary, figures and a report.

    Raises:
        UserError: Something asked for does not exist or does not fit.
    """
    request = request_of(
        scenarios,
        methods,
        model=model,
        settings=settings,
        vary=vary,
        data=data,
        source=source,
        seed=seed,
        against=against,
        plugins=plugins,
        jobs=jobs,
        start=start,
        dask=dask,
        world=world,
        traces=traces,
        unchecked_ramp=unchecked_ramp,
    )
    results = Results(tempfile.mkdtemp(prefix="merge-cosim-"), temporary=True) if out is None else Results(out)
    with sweep_progress(progress) as report:
        run_sweep(request, results.path, resume=resume, overwrite=overwrite, add=add, progress=report)
    return results

"""Sweeps: scenarios x methods x variations, in batches, on one or more processes."""

from __future__ import annotations

import hashlib
import multiprocessing
import platform
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

import merge_cosim
from merge_cosim.cosim.loop import Effort
from merge_cosim.encounter import Encounters
from merge_cosim.errors import UserError
from merge_cosim.experiments.methods import (
    CONSTANT,
    ORACLE_BEST,
    Method,
    default_methods,
    methods_for,
    split_settings,
)
from merge_cosim.experiments.scenario import Scenario, load_scenario
from merge_cosim.experiments.sources import SourceChoice, load_encounters
from merge_cosim.experiments.statistics import oracle_best, summarise
from merge_cosim.experiments.store import MANIFEST, SUMMARY_CSV, SUMMARY_JSON, ResultFolder
from merge_cosim.experiments.work import Batch, Workplace, run_batch, simulate_batch
from merge_cosim.intention.model import IntentionModel
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.registry import load_plugin

BATCH_CASES = 1_000
"""Most cases of one batch: enough to keep the tiles busy, few enough to lose little when interrupted."""
SINGLE_CASES = 5
"""Cases run one at a time to time a method's update in a batch of one."""

Progress = Callable[[int, int, str], None]
"""Told the cases done, the cases in all and what is being run."""


@dataclass(frozen=True)
class SweepRequest:
    """What the user asked for.

    Attributes:
        scenarios: Names or files.
        methods: Names; empty for all that there are.
        model: Model file or name; None for the one that goes with each scenario's source.
        settings: Values of scenario keys and of component parameters.
        variations: One name and its values each, varied one at a time.
        data: Folder with NGSIM files.
        source: Force real data or the surrogate.
        seed: SUMO's seed.
        plugins: Files with the user's own components.
        jobs: Processes.
    """

    scenarios: Sequence[str]
    methods: Sequence[str] = ()
    model: str | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    variations: Sequence[tuple[str, Sequence[Any]]] = ()
    data: Path | None = None
    source: SourceChoice | None = None
    seed: int = 0
    plugins: Sequence[Path] = ()
    jobs: int = 1


def plan(request: SweepRequest) -> list[Batch]:
    """Work out what to run, one batch per (scenario, variation, method); all mistakes of the user show here.

    Raises:
        UserError: Something asked for does not exist or does not fit.
    """
    for plugin in request.plugins:
        load_plugin(plugin)
    loaded: dict[str, Encounters] = {}
    batches: list[Batch] = []
    for varied, values in [("", [None]), *request.variations]:
        for value in values:
            settings = request.settings | ({varied: value} if varied else {})
            of_scenario, of_components = split_settings(settings)
            methods = _methods(request.methods, of_components)
            if varied in of_components:
                methods = [one for one in methods if varied.partition(".")[0] in (one.estimator, one.controller)]
            for scenario in _scenarios(request.scenarios, of_scenario, varied):
                key = repr((scenario.encounters, scenario.is_replay, scenario.ramp))
                if key not in loaded:
                    loaded[key] = load_encounters(scenario, request.data, request.source)
                label = f"{varied}={value}" if varied else ""
                batches += _scenario_batches(scenario, label, methods, loaded[key], request)
    if not batches:
        raise UserError("nothing to run: no method fits the scenarios")
    return batches


def _scenarios(names: Sequence[str], settings: dict[str, Any], varied: str) -> list[Scenario]:
    """Load the scenarios; one that does not know what is varied is left as it is, if another does."""
    loaded, refused = [], []
    for name in dict.fromkeys(names):
        try:
            loaded.append(load_scenario(name, settings))
        except UserError as error:
            if varied not in settings:
                raise
            refused.append(error)
    if not loaded:
        raise refused[0]
    return loaded


def _methods(names: Sequence[str], settings: dict[str, Any]) -> list[Method]:
    wanted = list(dict.fromkeys(names or default_methods()))
    if ORACLE_BEST in wanted:
        wanted = list(dict.fromkeys([*(name for name in wanted if name != ORACLE_BEST), *CONSTANT]))
    return [Method.parse(name, settings) for name in wanted]


def _scenario_batches(
    scenario: Scenario, variation: str, methods: list[Method], encounters: Encounters, request: SweepRequest
) -> Iterator[Batch]:
    encounters, left_out = _on_the_ramp(scenario, encounters)
    for source in np.unique(encounters.source):
        chosen = encounters.take(np.flatnonzero(encounters.source == source))
        for method in methods_for(chosen, methods):
            model = IntentionModel.load(request.model or default_model(str(source))) if method.needs_model else None
            if model is not None:
                _refuse_trained(scenario, chosen, model)
                method.driver(model)
            yield Batch(scenario, variation, method, model, chosen, request.seed, left_out)


def _on_the_ramp(scenario: Scenario, encounters: Encounters) -> tuple[Encounters, tuple[str, ...]]:
    """The encounters that the ramp has room for, and the names of the others."""
    ramp = Ramp.load(scenario.ramp)
    fits = ramp.holds(encounters.merge_position, encounters.host_station, encounters.merging_station)
    if not fits.any():
        merge_position = float(encounters.merge_position[0])
        ramp.place("main", float(encounters.host_station[0]), merge_position)
        ramp.place("ramp", float(encounters.merging_station[0]), merge_position)
    return encounters.take(np.flatnonzero(fits)), tuple(encounters.case[~fits].tolist())


def default_model(source: str) -> str:
    """Name of the project's own model for encounters of a source."""
    return "us101-surrogate" if source == "surrogate" else "us101-ngsim"


def _refuse_trained(scenario: Scenario, encounters: Encounters, model: IntentionModel) -> None:
    if not scenario.is_replay or model.source != str(encounters.source[0]):
        return
    known = sorted(set(encounters.car.tolist()) & set(model.trained_on))
    if known:
        raise UserError(
            f"scenario {scenario.name}: model {model.name} was trained on {len(known)} of its merging cars "
            f"(such as {known[0]}); choose another --model or split"
        )


def sweep(request: SweepRequest, out: Path, resume: bool = False, progress: Progress | None = None) -> dict[str, Any]:
    """Run a sweep and write its result folder; returns the manifest.

    Raises:
        UserError: See `plan` and `ResultFolder.begin`.
    """
    begin = perf_counter()
    batches = plan(request)
    folder = ResultFolder(out)
    folder.begin(_identity(request, batches), resume)
    pieces = {name: piece for number, batch in enumerate(batches) for name, piece in _pieces(number, batch)}
    done = folder.done()
    open_pieces = {name: piece for name, piece in pieces.items() if name not in done}
    total = sum(len(piece.encounters) for piece in pieces.values())
    finished = total - sum(len(piece.encounters) for piece in open_pieces.values())
    effort = Effort()
    method_effort: dict[str, Effort] = {}
    for name, rows, cost in _run_all(open_pieces, request):
        folder.add(name, rows)
        effort.add(cost)
        method_effort.setdefault(pieces[name].method.name, Effort()).add(cost)
        finished += len(rows)
        if progress:
            progress(finished, total, f"{pieces[name].scenario.name} {pieces[name].method.name}")
    loop_s = perf_counter() - begin
    rows = folder.part_rows()
    more = [oracle_best(rows)] if not request.methods or ORACLE_BEST in request.methods else []
    rows = folder.merge(more)
    single_us, traces = _alone(batches, rows)
    folder.write_traces(traces)
    cycle_us = {name: (1e6 * e.method_s / e.encounter_cycles, single_us.get(name)) for name, e in method_effort.items()}
    summary = summarise(rows, cycle_us)
    summary.to_csv(out / SUMMARY_CSV, index=False)
    folder.write_json(SUMMARY_JSON, summary.astype(object).where(summary.notna(), None).to_dict("records"))
    manifest = {
        **_identity(request, batches),
        "left_out": {batch.scenario.name: list(batch.left_out) for batch in batches if batch.left_out},
        "command": {"jobs": request.jobs, "resumed": resume},
        "wall_s": round(perf_counter() - begin, 3),
        "loop_wall_s": round(loop_s, 3),
        "vehicle_steps": effort.vehicle_steps,
        "vehicle_steps_per_s": round(effort.vehicle_steps / loop_s) if loop_s else None,
        "ratio_to_bare_sumo": round(effort.wall_s / effort.step_s, 3) if effort.step_s else None,
        "worst_station_difference_m": effort.worst_difference_m,
    }
    folder.write_json(MANIFEST, manifest)
    folder.finish()
    return manifest


def _pieces(number: int, batch: Batch) -> Iterator[tuple[str, Batch]]:
    n = len(batch.encounters)
    pieces = max(1, -(-n // BATCH_CASES))
    for piece, cases in enumerate(np.array_split(np.arange(n), pieces)):
        yield f"{number:04d}-{piece:05d}", replace(batch, encounters=batch.encounters.take(cases))


def _run_all(pieces: dict[str, Batch], request: SweepRequest) -> Iterator[tuple[str, pa.Table, Effort]]:
    jobs = min(request.jobs, len(pieces))
    if jobs <= 1:
        workplace = Workplace()
        try:
            for name, piece in pieces.items():
                yield name, *run_batch(piece, workplace)
        finally:
            workplace.close()
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, initializer=_start_worker, initargs=(tuple(request.plugins),)) as pool:
        waiting = iter(pieces.items())
        running: dict[Future[tuple[pa.Table, Effort]], str] = {}
        try:
            while True:
                for name, piece in waiting:
                    running[pool.submit(_work, piece)] = name
                    if len(running) > jobs:
                        break
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), *future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


_workplace: Workplace | None = None


def _start_worker(plugins: Sequence[Path]) -> None:
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interrupt means
    for plugin in plugins:
        load_plugin(plugin)


def _work(piece: Batch) -> tuple[pa.Table, Effort]:
    global _workplace
    if _workplace is None:
        _workplace = Workplace()
    return run_batch(piece, _workplace)


def _alone(batches: list[Batch], rows: pa.Table) -> tuple[dict[str, float], pa.Table]:
    """Run a few cases of each scenario and method one at a time, the most telling one first and recorded.

    Returns:
        Time of one update in a batch of one [us] by method, and the records of the telling cases.
    """
    frame = rows.to_pandas()
    efforts: dict[str, Effort] = {}
    records = []
    workplace = Workplace(tiles=1)
    for batch in batches:
        if batch.variation:
            continue
        case = _telling_case(frame[(frame["scenario"] == batch.scenario.name) & (frame["variation"] == "")])
        order = np.argsort(batch.encounters.case != case, kind="stable")[:SINGLE_CASES]
        few = replace(batch, encounters=batch.encounters.take(order))
        ramp = Ramp.load(batch.scenario.ramp)
        run = simulate_batch(few, workplace.plant(ramp, 1, batch.seed), ramp, traced=(0,))
        efforts.setdefault(batch.method.name, Effort()).add(run.effort)
        names = {"scenario": batch.scenario.name, "case": str(few.encounters.case[0]), "method": batch.method.name}
        records.append(pd.DataFrame(run.traces[0]).assign(**names))
    workplace.close()
    times = {name: 1e6 * effort.method_s / effort.encounter_cycles for name, effort in efforts.items()}
    return times, pa.Table.from_pandas(pd.concat(records), preserve_index=False)


def _telling_case(rows: pd.DataFrame) -> str:
    """The case on which the methods differ most: in failing, then in where they are when the host arrives."""
    by_case = rows.groupby("case")
    failing = by_case["failed"].mean()
    spread = by_case["distance_m"].max() - by_case["distance_m"].min()
    order = pd.DataFrame({"split": failing * (1 - failing), "spread": spread.fillna(0.0)})
    return str(order.sort_values(["split", "spread"], ascending=False, kind="stable").index[0])


def _identity(request: SweepRequest, batches: list[Batch]) -> dict[str, Any]:
    """What makes two sweeps the same: the same rows come out of the same identity."""
    models = {batch.model.name: batch.model for batch in batches if batch.model}
    return {
        "versions": {
            "merge-cosim": merge_cosim.__version__,
            "libsumo": version("libsumo"),
            "numpy": version("numpy"),
            "python": platform.python_version(),
        },
        "seed": request.seed,
        "methods": sorted({batch.method.name for batch in batches}),
        "settings": {key: str(value) for key, value in request.settings.items()},
        "variations": [[name, [str(value) for value in values]] for name, values in request.variations],
        "models": {name: _digest(model.to_json()) for name, model in models.items()},
        "scenarios": {
            " ".join(filter(None, (batch.scenario.name, batch.variation))): batch.scenario.model_dump(mode="json")
            for batch in batches
        },
        "encounters": _digest("".join(batch.encounters.digest() for batch in batches)),
        "plugins": {plugin.name: hashlib.sha256(plugin.read_bytes()).hexdigest()[:16] for plugin in request.plugins},
    }


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]

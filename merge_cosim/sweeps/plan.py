"""From the user's request to tasks, one per (scenario, variation, method)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import load_plugin
from merge_cosim.core.units import IntArray
from merge_cosim.estimators.learned.model import IntentionModel, load_models
from merge_cosim.ramps.check import refuse_unsound
from merge_cosim.ramps.ramp import Ramp, find_ramp
from merge_cosim.results.statistics.comparison import reference_of
from merge_cosim.scenarios.encounters import SourceChoice, load_encounters
from merge_cosim.scenarios.logged_scenes import load_scenes
from merge_cosim.scenarios.methods import (
    CONSTANT,
    ORACLE_BEST,
    Method,
    MethodSpec,
    default_methods,
    methods_for,
    refuse_unused,
)
from merge_cosim.scenarios.random_states import SOURCE as RANDOM
from merge_cosim.scenarios.random_states import RandomStates
from merge_cosim.scenarios.scenario import Scenario, load_scenario
from merge_cosim.scenarios.settings import split_settings
from merge_cosim.scenarios.sources import Random, Routes, Traffic
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.simulation.worlds.traffic import TRAFFIC
from merge_cosim.sumo.configuration import Configuration
from merge_cosim.sumo.lane_map import LaneMap
from merge_cosim.sumo.vehicle_types import ROLE
from merge_cosim.sweeps.cases import LoggedCases, PairCases
from merge_cosim.sweeps.closed_form_cases import ClosedFormCases, side_by_side
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.traffic_cases import TrafficCases

StartMethod = Literal["spawn", "forkserver", "fork"]
ScenarioSpec: TypeAlias = str | Scenario | tuple[Scenario, Encounters]
"""Name or file of a scenario, a scenario, or one along with its encounters."""


@dataclass(frozen=True)
class SweepRequest:
    """What the user asked for.

    Attributes:
        scenarios: Names or files, or the scenarios themselves.
        methods: Names, components or pairs of them, see `Method.of`; empty for all that there are.
        model: Model file or name, or the model itself; None for the one that goes with each scenario's source.
        settings: Values of scenario keys and of component parameters.
        variations: One name and its values each, varied one at a time.
        data: Folder with NGSIM files.
        source: Force real data or the surrogate.
        seed: SUMO's seed.
        plugins: Files with the user's own components.
        jobs: Number of processes.
        start: How processes come to be, see `executors.Processes`.
        dask: Address of a Dask scheduler, or `local`; None for processes of this machine.
        against: Method that the others are compared with on the same cases; None for pgm, if it is there.
        world: What moves the cars.
        unchecked_ramp: Run on ramps that do not pass `ramps.check`, too.
        traces: Cases that are recorded cycle by cycle, see `sweeps.traces.Traces`.
    """

    scenarios: Sequence[ScenarioSpec]
    methods: Sequence[MethodSpec] = ()
    model: str | IntentionModel | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    variations: Sequence[tuple[str, Sequence[Any]]] = ()
    data: Path | None = None
    source: SourceChoice | None = None
    seed: int = 0
    plugins: Sequence[Path] = ()
    jobs: int = 1
    start: StartMethod = "spawn"
    dask: str | None = None
    against: str | None = None
    world: WorldKind = "sumo"
    unchecked_ramp: bool = False
    traces: Literal["all", "failed", "telling"] | int | None = None


def plan(request: SweepRequest) -> list[Task]:
    """Work out what to run, one task per (scenario, variation, method); every mistake in the request raises here.

    In whatever order the user names scenarios and methods, the tasks come in the same one: a resumed sweep knows its
    chunks by their numbers.

    Raises:
        UserError: Something asked for does not exist or does not fit.
    """
    for plugin in request.plugins:
        load_plugin(plugin)
    loaded: dict[str, Encounters] = {}
    tasks: list[Task] = []
    labels: set[str] = set()
    for varied, values in [("", [None]), *request.variations]:
        for value in values:
            label = f"{varied}={value}" if varied else ""
            if label in labels:  # asked for twice
                continue
            labels.add(label)
            settings = request.settings | ({varied: value} if varied else {})
            own = [part for method in _methods(request.methods, {}) for part in method.objects if part is not None]
            of_scenario, of_components = split_settings(settings, own)
            methods = _methods(request.methods, of_components)
            refuse_unused(of_components, methods)
            if varied in of_components:
                methods = [method for method in methods if varied in method.parameters()]
            for scenario, given in _scenarios(request.scenarios, of_scenario, varied):
                tasks += tasks_of(scenario, label, methods, request, loaded, given)
    if not tasks:
        raise UserError("nothing to run: no method fits the scenarios")
    if isinstance(request.model, str) and not any(task.method.needs_model for task in tasks):
        load_models(request.model)  # a mistake in it is told all the same
    reference_of(method_names(request, tasks), request.against)
    return sorted(
        tasks, key=lambda task: tuple(task.names[name] for name in ("scenario", "variation", "method", "model"))
    )


def refuse_unsound_ramps(request: SweepRequest, tasks: Sequence[Task]) -> None:
    """Refuse ramps that do not pass `ramps.check`, unless the user wants them all the same.

    Raises:
        UserError: One does not.
    """
    for ramp in () if request.unchecked_ramp else dict.fromkeys(task.scenario.ramp for task in tasks):
        refuse_unsound(find_ramp(ramp))


def tasks_of(
    scenario: Scenario,
    variation: str,
    methods: list[Method],
    request: SweepRequest,
    loaded: dict[str, Encounters],
    given: Encounters | None = None,
) -> Iterator[Task]:
    """The tasks of one scenario under some methods.

    Args:
        scenario: The scenario, variation applied.
        variation: What was varied in it.
        methods: The methods; those that cannot run on it are left out.
        request: Data, models, seed and world.
        loaded: Encounters that other scenarios share; what is loaded is added.
        given: Its encounters, where a Python program hands them over.

    Raises:
        UserError: Its data are missing or do not fit.
    """
    if scenario.is_scene:
        return _traffic_tasks(scenario, variation, methods, request)
    if given is None and isinstance(scenario.encounters, Random) and scenario.full_scene is None:
        return _encounter_tasks(scenario, variation, methods, RandomStates.of(scenario.encounters), request)
    key = scenario.encounters_key if given is None else scenario.name
    if key not in loaded:
        found = load_encounters(scenario, request.data, request.source) if given is None else given
        loaded[key] = _by_name(found)
    return _encounter_tasks(scenario, variation, methods, loaded[key], request)


def method_names(request: SweepRequest, tasks: Sequence[Task]) -> list[str]:
    """Names of all methods that will have rows."""
    derived = {ORACLE_BEST} if not request.methods or ORACLE_BEST in request.methods else set()
    return sorted({task.method.name for task in tasks} | derived)


def _scenarios(
    specs: Sequence[ScenarioSpec], settings: dict[str, Any], varied: str
) -> list[tuple[Scenario, Encounters | None]]:
    """Load the scenarios; one without the varied key stays as it is, if another scenario has it."""
    loaded: dict[str, tuple[Scenario, Encounters | None]] = {}
    refused = []
    for number, spec in enumerate(specs):
        if isinstance(spec, str) and spec in specs[:number]:  # asked for twice
            continue
        named, given = spec if isinstance(spec, tuple) else (spec, None)
        try:
            scenario = load_scenario(named, settings)
            if scenario.name in loaded:
                where = spec if isinstance(spec, str) else "scenarios"
                raise UserError(f"{where}: another scenario is called '{scenario.name}', too; rename one")
            loaded[scenario.name] = scenario, given
        except UserError as error:
            if varied not in settings:
                raise
            refused.append(error)
    if not loaded:
        raise refused[0]
    return list(loaded.values())


def _methods(specs: Sequence[MethodSpec], settings: dict[str, Any]) -> list[Method]:
    wanted: list[MethodSpec] = [*(specs or default_methods())]
    if any(isinstance(spec, str) and spec == ORACLE_BEST for spec in wanted):
        wanted = [*(spec for spec in wanted if spec != ORACLE_BEST), *CONSTANT]
    made: dict[str, Method] = {}
    for spec in wanted:
        method = Method.of(spec, settings)
        if made.setdefault(method.name, method) != method:
            raise UserError(f"two methods are called '{method.name}'; give the object of one another `name`")
    return list(made.values())


def _traffic_tasks(scenario: Scenario, variation: str, methods: list[Method], request: SweepRequest) -> Iterator[Task]:
    traffic = scenario.encounters
    assert isinstance(traffic, (Routes, Traffic))
    if request.world == "closed-form":
        raise _needs_sumo(scenario, "traffic")
    if isinstance(traffic, Routes):
        if request.dask is not None:
            raise UserError(f"{traffic.file}: route files with traffic run on this machine; leave out --dask")
        configuration = Configuration.read(traffic.file)
        if traffic.host:
            configuration.require(traffic.host)
        elif not configuration.names_role("host"):
            raise UserError(
                f'{traffic.file}: no car is the host; add <param key="{ROLE}" value="host"/> to a vType, or name a '
                f"vehicle or type: --set encounters.host=ID"
            )
    load = cache(load_models)
    for method in methods:
        if method.is_human or method.needs_label:
            continue
        for model in _models(method, TRAFFIC, request, load):
            yield Task(
                scenario=scenario,
                cases=TrafficCases(traffic, 0, traffic.replications),
                variation=variation,
                method=method,
                model=model,
                seed=request.seed,
            )


def _models(
    method: Method, source: str, request: SweepRequest, load: Callable[[str], Sequence[IntentionModel]]
) -> Sequence[IntentionModel | None]:
    """The learned models that a method is to be run with, checked to fit it; None for a method without one."""
    if not method.needs_model:
        return [None]
    chosen = request.model or default_model(source)
    models = [chosen] if isinstance(chosen, IntentionModel) else load(chosen)
    for model in models:
        method.driver(model)
    return models


def _encounter_tasks(
    scenario: Scenario,
    variation: str,
    methods: list[Method],
    encounters: Encounters | RandomStates,
    request: SweepRequest,
) -> Iterator[Task]:
    load = cache(load_models)
    left_out: tuple[str, ...] = ()
    if isinstance(encounters, Encounters) or not _all_on_the_ramp(scenario, encounters):
        every = encounters if isinstance(encounters, Encounters) else encounters.encounters()
        encounters, left_out = _on_the_ramp(scenario, every)
    for source, cases in _by_source(scenario, encounters, request):
        for method in methods_for(cases.part(0, 1).encounters if source == RANDOM else cases.encounters, methods):
            models = _models(method, source, request, load)
            for model in models:
                tested = cases if model is None else _not_trained_on(scenario, cases, model, several=len(models) > 1)
                yield Task(
                    scenario=scenario,
                    cases=tested,
                    variation=variation,
                    method=method,
                    model=model,
                    seed=request.seed,
                    left_out=left_out,
                )


def _by_source(
    scenario: Scenario, encounters: Encounters | RandomStates, request: SweepRequest
) -> Iterator[tuple[str, PairCases]]:
    """The cases of each source."""

    def without_traffic(pairs: Encounters | RandomStates) -> PairCases:
        if request.world == "closed-form":
            return ClosedFormCases(pairs, host=scenario.host, side_by_side=side_by_side(scenario.test))
        return PairCases(pairs, host=scenario.host)

    if isinstance(encounters, RandomStates):
        yield RANDOM, without_traffic(encounters)
        return
    for source in dict.fromkeys(encounters.source.tolist()):
        chosen = _taken(encounters, np.flatnonzero(encounters.source == source))
        in_scenes = scenario.full_scene is not None
        yield source, _in_scenes(scenario, chosen, source, request) if in_scenes else without_traffic(chosen)


def _in_scenes(scenario: Scenario, encounters: Encounters, source: str, request: SweepRequest) -> LoggedCases:
    """The encounters, each with the logged cars around it."""
    assert scenario.full_scene is not None
    if request.world == "closed-form":
        raise _needs_sumo(scenario, "full_scene")
    try:
        data = None if request.source == "surrogate" else request.data
        return LoggedCases.of(encounters, scenario.full_scene, load_scenes(scenario, source, data))
    except UserError as error:
        raise UserError(f"scenario {scenario.name}: {error}") from None


def _needs_sumo(scenario: Scenario, why: str) -> UserError:
    return UserError(
        f"scenario {scenario.name}: {why} needs SUMO to move the other cars; leave out --world closed-form"
    )


def _all_on_the_ramp(scenario: Scenario, states: RandomStates) -> bool:
    """Whether the ramp has room for the whole range of random states."""
    hosts = states.host_stations
    stations = {scenario.host: hosts, scenario.other: np.full(2, states.states.merging_station)}
    return bool(Ramp.load(scenario.ramp).holds(np.zeros(2), stations["main"], stations["ramp"]).all())


def _on_the_ramp(scenario: Scenario, encounters: Encounters) -> tuple[Encounters, tuple[str, ...]]:
    """The encounters that the ramp has room for, and the names of the others."""
    if not len(encounters):
        raise UserError(
            f"scenario {scenario.name}: no encounter is left to run; lower encounters.fraction, if it is set"
        )
    ramp = Ramp.load(scenario.ramp)
    paths = {scenario.host: encounters.host_station, scenario.other: encounters.merging_station}
    fits = ramp.holds(encounters.merge_position, paths["main"], paths["ramp"])
    if not fits.any():
        merge_position = float(encounters.merge_position[0])
        lanes = LaneMap(ramp)
        for path, station in paths.items():
            lanes.place(path, float(station[0]), merge_position)
    return _taken(encounters, np.flatnonzero(fits)), tuple(encounters.case[~fits].tolist())


def _by_name(encounters: Encounters) -> Encounters:
    """Sorted as results are stored, so that a part of a sweep holds a stretch of the stored rows."""
    if (encounters.case[:-1] <= encounters.case[1:]).all():
        return encounters
    return encounters.take(np.argsort(encounters.case, kind="stable"))


def _taken(encounters: Encounters, rows: IntArray) -> Encounters:
    """The chosen encounters; no copy where that is all of them."""
    return encounters if len(rows) == len(encounters) else encounters.take(rows)


def default_model(source: str) -> str:
    """Name of the project's own model for encounters of a source.

    Where no real pair is tested, it is the one trained on all real cars.
    """
    return {"surrogate": "us101-surrogate", "ngsim": "us101-ngsim"}.get(source, "us101-ngsim-all")


def _not_trained_on(scenario: Scenario, cases: PairCases, model: IntentionModel, several: bool) -> PairCases:
    """The cases whose merging cars a model was not trained on, where it is one of several; else all, or a refusal."""
    if not scenario.is_replay or model.source != str(cases.encounters.source[0]):
        return cases
    trained = np.isin(cases.encounters.car, model.trained_on)
    if not trained.any():
        return cases
    if several and not trained.all():
        return cases.take(np.flatnonzero(~trained))
    known = sorted(set(cases.encounters.car[trained].tolist()))
    raise UserError(
        f"scenario {scenario.name}: model {model.name} was trained on {len(known)} of its merging cars "
        f"(such as {known[0]}); choose another --model or split"
    )

"""From what a Python user hands over to a request that can be planned."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import Component
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.data import find_data
from merge_cosim.scenarios.encounters import SourceChoice
from merge_cosim.scenarios.methods import MethodSpec
from merge_cosim.scenarios.scenario import Scenario, family, scenario_of
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.sweeps.plan import ScenarioSpec, StartMethod, SweepRequest
from merge_cosim.sweeps.traces import parse_traces

ScenarioLike: TypeAlias = str | Path | Scenario | Encounters
"""The name of a shipped scenario or of a family of them, a scenario file, a SUMO configuration, a scenario, or
initial states."""
Scenarios: TypeAlias = ScenarioLike | Sequence[ScenarioLike] | Mapping[str, Scenario | Encounters]
"""One scenario, several, or several by names of the user's choice."""
Methods: TypeAlias = MethodSpec | Sequence[MethodSpec] | None


def request_of(
    scenarios: Scenarios,
    methods: Methods,
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
    traces: str | int | None = None,
    unchecked_ramp: bool = False,
) -> SweepRequest:
    """Make a request; the arguments are those of `merge_cosim.sweep`.

    Raises:
        UserError: Something handed over is of a wrong type, or the data folder does not exist.
    """
    return SweepRequest(
        scenarios=_scenarios(scenarios),
        methods=_methods(methods),
        model=str(model) if isinstance(model, Path) else model,
        settings=dict(settings or {}),
        variations=[(name, list(values)) for name, values in (vary or {}).items()],
        data=find_data(data),
        source=source,
        seed=seed,
        plugins=[Path(plugin) for plugin in plugins],
        jobs=jobs or os.cpu_count() or 1,
        start=start,
        dask=dask,
        against=against,
        world=world,
        unchecked_ramp=unchecked_ramp,
        traces=parse_traces(traces),
    )


def _scenarios(given: Scenarios) -> list[ScenarioSpec]:
    if isinstance(given, Mapping):
        return [_named(name, one) for name, one in given.items()]
    several = [given] if isinstance(given, (str, Path, Scenario, Encounters)) else list(given)
    unnamed = sum(isinstance(one, Encounters) for one in several)
    if unnamed > 1:
        raise UserError(f"{unnamed} batches of encounters need names: mc.sweep({{'first': encounters, ...}})")
    specs: list[ScenarioSpec] = []
    for one in several:
        spec = _named("encounters", one) if isinstance(one, Encounters) else _checked(one)
        specs += family(spec) if isinstance(spec, str) else [spec]
    return specs


def _named(name: str, given: Scenario | Encounters) -> ScenarioSpec:
    if isinstance(given, Encounters):
        return scenario_of(given, name), given
    if isinstance(given, Scenario):
        return given.model_copy(update={"name": name})
    raise UserError(f"scenario {name}: {given!r} is neither a Scenario nor Encounters")


def _checked(given: object) -> str | Scenario:
    if isinstance(given, (str, Path)):
        return str(given)
    if isinstance(given, Scenario):
        return given
    raise UserError(f"{given!r} is no scenario: give a name, a file, a Scenario or Encounters")


def _methods(given: Methods) -> list[MethodSpec]:
    if given is None:
        return []
    return [given] if isinstance(given, str | Component | type) else list(given)

"""Lists of all registered components with their parameters."""

import inspect
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from merge_cosim.controllers.base import controllers
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import Registry, described, did_you_mean, load_plugin
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.scenarios.methods import CONSTANT, HUMAN, ORACLE_BEST
from merge_cosim.sensors.base import sensors

DERIVED = {
    ORACLE_BEST: f"The better of {' and '.join(CONSTANT)} on each case (made by the statistics).",
    HUMAN: "The logged host itself, on replay (made from the log).",
}
"""Methods without an estimator."""


def components(plugins: Sequence[Path] = ()) -> list[dict[str, Any]]:
    """Return role, name, parameters (with defaults) and first line of the documentation of each component."""
    rows = [
        {
            "role": registry.role,
            "name": name,
            "about": _documentation(cls).partition("\n")[0],
            "parameters": {row["name"]: row["default"] for row in described(cls)},
        }
        for registry, name, cls in _registered(plugins)
    ]
    return [*rows, *({"role": "derived", "name": n, "about": about, "parameters": {}} for n, about in DERIVED.items())]


def component(name: str, plugins: Sequence[Path] = ()) -> list[dict[str, Any]]:
    """Return role, name, documentation and described parameters of the components of a name.

    Args:
        name: A component or a method; `acc` is an estimator and a controller, `pgm+lqr` names one of each.
        plugins: Files with the user's own components.

    Raises:
        UserError: There is none of this name.
    """
    known = [(registry.role, part, cls) for registry, part, cls in _registered(plugins)]
    wanted, _, with_controller = name.partition("+")
    rows = [
        {"role": role, "name": part, "about": _documentation(cls)}
        | ({"controller": cls.default_controller} if issubclass(cls, Estimator) else {})
        | {"parameters": described(cls)}
        for role, part, cls in known
        if part == (with_controller if with_controller and role == controllers.role else wanted)
        and not (with_controller and role in (merging_cars.role, sensors.role))
    ]
    rows += [
        {"role": "derived", "name": n, "about": about, "parameters": []} for n, about in DERIVED.items() if n == name
    ]
    found = {row["name"] for row in rows}
    for part in filter(None, (wanted, with_controller)):
        if part not in found:
            raise UserError(
                f"unknown component '{part}'{did_you_mean(part, [*(one for _, one, _ in known), *DERIVED])}"
            )
    return rows


def _registered(plugins: Sequence[Path]) -> Iterator[tuple[Registry[Any], str, type]]:
    for plugin in plugins:
        load_plugin(plugin)
    registries: tuple[Registry[Any], ...] = (estimators, controllers, merging_cars, sensors)
    for registry in registries:
        for name in registry.names():
            yield registry, name, registry[name]


def _documentation(cls: type) -> str:
    """The docstring without its table of parameters, which is given by `described`."""
    return inspect.cleandoc(cls.__doc__ or "").partition("\nAttributes:\n")[0].strip()

"""What there is: every registered component with its parameters."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from merge_cosim.controllers.base import controllers
from merge_cosim.core.registry import Registry, load_plugin, parameters
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.scenarios.methods import CONSTANT, HUMAN, ORACLE_BEST


def components(plugins: Sequence[Path] = ()) -> list[dict[str, Any]]:
    """Return role, name, parameters (with defaults) and first line of the documentation of each component."""
    for plugin in plugins:
        load_plugin(plugin)
    registries: tuple[Registry[Any], ...] = (estimators, controllers, merging_cars)
    rows = [
        {
            "role": registry.role,
            "name": name,
            "about": (registry[name].__doc__ or "").strip().splitlines()[0],
            "parameters": parameters(registry[name]),
        }
        for registry in registries
        for name in registry.names()
    ]
    derived = {
        ORACLE_BEST: f"The better of {' and '.join(CONSTANT)} on each case (made by the statistics).",
        HUMAN: "The logged host itself, on replay (made from the log).",
    }
    return [*rows, *({"role": "derived", "name": n, "about": about, "parameters": {}} for n, about in derived.items())]

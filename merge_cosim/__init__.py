"""merge-cosim: SUMO co-simulation of freeway on-ramp merging between an autonomous host and a human driver.

In Python, all that is meant for users is here: `import merge_cosim as mc`, then `mc.sweep(...)`, `mc.run(...)` and so
on; `dir(mc)` lists the names. They are imported when they are first used, so that `import merge_cosim` is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from merge_cosim.api.listing import list_methods, list_models, list_ramps, list_scenarios
    from merge_cosim.api.results import Results, load_results
    from merge_cosim.api.run import Run, run
    from merge_cosim.api.studies import Training, bounds, export, reproduce, train, train_ensemble
    from merge_cosim.api.sweep import sweep
    from merge_cosim.controllers.base import Controller, controller
    from merge_cosim.core.encounter import Encounters, Intention
    from merge_cosim.core.errors import UserError
    from merge_cosim.core.observation import Observation, Setting
    from merge_cosim.estimators.base import Estimator, estimator
    from merge_cosim.estimators.learned.model import IntentionModel
    from merge_cosim.merging_cars.base import MergingCar, merging_car
    from merge_cosim.ramps.ramp import Ramp
    from merge_cosim.scenarios.scenario import Scenario, load_scenario
    from merge_cosim.sensors.base import Sensor, sensor
    from merge_cosim.sweeps.listener import HostListener

_HOME = {
    "Controller": "controllers.base",
    "Encounters": "core.encounter",
    "Estimator": "estimators.base",
    "HostListener": "sweeps.listener",
    "Intention": "core.encounter",
    "IntentionModel": "estimators.learned.model",
    "MergingCar": "merging_cars.base",
    "Observation": "core.observation",
    "Ramp": "ramps.ramp",
    "Results": "api.results",
    "Run": "api.run",
    "Scenario": "scenarios.scenario",
    "Sensor": "sensors.base",
    "Setting": "core.observation",
    "Training": "api.studies",
    "UserError": "core.errors",
    "bounds": "api.studies",
    "controller": "controllers.base",
    "estimator": "estimators.base",
    "export": "api.studies",
    "list_methods": "api.listing",
    "list_models": "api.listing",
    "list_ramps": "api.listing",
    "list_scenarios": "api.listing",
    "load_results": "api.results",
    "load_scenario": "scenarios.scenario",
    "merging_car": "merging_cars.base",
    "reproduce": "api.studies",
    "run": "api.run",
    "sensor": "sensors.base",
    "sweep": "api.sweep",
    "train": "api.studies",
    "train_ensemble": "api.studies",
}
"""The module that each name is defined in."""

__all__ = [  # noqa: RUF022 - in the order in which a reader meets them
    "sweep",
    "run",
    "train",
    "train_ensemble",
    "load_results",
    "load_scenario",
    "list_methods",
    "list_models",
    "list_ramps",
    "list_scenarios",
    "bounds",
    "export",
    "reproduce",
    "Results",
    "Run",
    "Training",
    "Ramp",
    "Scenario",
    "Encounters",
    "Intention",
    "IntentionModel",
    "Estimator",
    "Controller",
    "MergingCar",
    "Sensor",
    "estimator",
    "controller",
    "merging_car",
    "sensor",
    "Observation",
    "Setting",
    "HostListener",
    "UserError",
]


def __getattr__(name: str) -> Any:
    """Import a name on its first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    found = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])

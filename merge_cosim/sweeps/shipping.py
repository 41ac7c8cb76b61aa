"""Tasks as bytes for other processes and machines, together with the user's classes that they need.

A class of a notebook or a script cannot be imported elsewhere, so cloudpickle sends its code. The same is done for a
module in the script's folder; modules of an installed package, and plugin files, are imported by the worker.
"""

from __future__ import annotations

import dataclasses
import pickle
import sys
import sysconfig
from collections import ChainMap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import cloudpickle

from merge_cosim.controllers.base import controllers
from merge_cosim.core.registry import PLUGIN, Component, Registry, source_of
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.sensors.base import sensors
from merge_cosim.sweeps.task import Task

REGISTRIES: dict[str, Registry[Any]] = {one.role: one for one in (estimators, controllers, merging_cars, sensors)}


def own_classes(task: Task) -> list[type[Component]]:
    """Classes of the task's method, merging car and sensor that are not of this package."""
    scenario = task.scenario
    named = ((merging_cars, scenario.merging.get("model")), (sensors, scenario.sensing.get("model")))
    others: list[type[Component]] = [registry[str(model)] for registry, model in named if str(model) in registry]
    classes = [*task.method.classes(), *others]
    package = __package__.partition(".")[0]
    return [cls for cls in classes if cls.__module__.partition(".")[0] != package]


def sources(tasks: Sequence[Task]) -> dict[str, str]:
    """Text of the classes that are not of this package, by their names."""
    return {cls.name: source_of(cls) for task in tasks for cls in own_classes(task)}


class _Pickler(cloudpickle.Pickler):  # type: ignore[misc]
    """cloudpickle's; by default it copies the marks of dataclass fields, which are compared by identity."""

    dispatch_table: ClassVar = ChainMap(
        {
            type(getattr(dataclasses, name)): lambda _, name=name: (getattr, (dataclasses, name))
            for name in ("MISSING", "KW_ONLY", "_HAS_DEFAULT_FACTORY")
        },
        cloudpickle.Pickler.dispatch_table,
    )


def dumps(value: object) -> bytes:
    """Any value as bytes, to be read by `pickle.loads`; the code of classes of `__main__` is in them."""
    file = BytesIO()
    _Pickler(file).dump(value)
    return file.getvalue()


def pack(task: Task) -> bytes:
    """A task with the classes that it needs."""
    registered = [
        (registry.role, cls)
        for cls in own_classes(task)
        for registry in REGISTRIES.values()
        if cls.name in registry and registry[cls.name] is cls
    ]
    modules = {sys.modules[cls.__module__] for cls in own_classes(task) if _lies_beside(cls.__module__)}
    for module in modules:
        cloudpickle.register_pickle_by_value(module)
    try:
        return dumps((registered, task))
    finally:
        for module in modules:
            cloudpickle.unregister_pickle_by_value(module)


def unpack(packed: bytes) -> Task:
    """The task; its classes are entered in this process's registries."""
    task: Task
    registered, task = pickle.loads(packed)
    for role, cls in registered:
        REGISTRIES[role].register(cls)
    return task


@contextmanager
def main_hidden() -> Iterator[None]:
    """Processes that are started here do not run the user's script again; its classes come with the tasks."""
    main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _lies_beside(module: str) -> bool:
    """Whether a module is a file of the user's, neither installed nor a plugin."""
    file = getattr(sys.modules.get(module), "__file__", None)
    if module == "__main__" or file is None or module.startswith(PLUGIN):
        return False
    installed = {Path(path).resolve() for path in sysconfig.get_paths().values()}
    return not installed & set(Path(file).resolve().parents)

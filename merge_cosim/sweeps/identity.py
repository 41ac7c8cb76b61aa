"""What the rows of a sweep depend on: sweeps of the same identity have the same rows on any machine."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import merge_cosim
from merge_cosim.ramps.definition import FILE_NAME
from merge_cosim.ramps.ramp import Ramp, find_ramp
from merge_cosim.sweeps.plan import SweepRequest, method_names
from merge_cosim.sweeps.shipping import sources
from merge_cosim.sweeps.task import Task


def identity(request: SweepRequest, tasks: Sequence[Task]) -> dict[str, Any]:
    """All that the rows of a sweep depend on; it stands in the manifest."""
    models = {task.model.name: task.model for task in tasks if task.model}
    return {
        "versions": software(),
        "world": request.world,
        "seed": request.seed,
        "source": request.source,
        "methods": method_names(request, tasks),
        "parameters": {
            " ".join(filter(None, (task.method.name, task.variation))): {
                name: value if isinstance(value, int | float | str) else str(value)
                for name, value in task.method.parameters().items()
            }
            for task in tasks
        },
        "components": sources(tasks),
        "against": request.against,
        "settings": {key: str(value) for key, value in request.settings.items()},
        "variations": [[name, [str(value) for value in values]] for name, values in request.variations],
        "models": {name: digest(model.to_json().encode()) for name, model in models.items()},
        "ramps": {ramp: digest_of(ramp_files(ramp)) for ramp in sorted({task.scenario.ramp for task in tasks})},
        "scenarios": {
            " ".join(filter(None, (task.scenario.name, task.variation))): task.scenario.model_dump(mode="json")
            for task in tasks
        },
        "encounters": _encounters(tasks),
        "plugins": {plugin.name: digest(plugin.read_bytes()) for plugin in request.plugins},
    }


def _encounters(tasks: Sequence[Task]) -> dict[str, str]:
    """A digest of the cases of each scenario and variation; the same whichever methods drive in them."""
    found: dict[str, dict[str, None]] = {}
    for task in tasks:
        found.setdefault(" ".join(filter(None, (task.scenario.name, task.variation))), {})[task.digest()] = None
    return {name: digest(*map(str.encode, sorted(parts))) for name, parts in found.items()}


def versions() -> dict[str, str]:
    """Versions of what results depend on."""
    return {
        "merge-cosim": merge_cosim.__version__,
        "libsumo": version("libsumo"),
        "numpy": version("numpy"),
        "python": platform.python_version(),
    }


@cache
def software() -> Mapping[str, str]:
    """The versions, and a digest of this package's source: two states of the code may have the same version."""
    folder = Path(merge_cosim.__file__).parent
    source = {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*.py")}
    return versions() | {"merge-cosim's source": digest_of(source)}


def ramp_files(ramp: str) -> dict[str, bytes]:
    """The files that a ramp consists of, by name: its `ramp.toml` and its net."""
    files = (find_ramp(ramp) / FILE_NAME, Ramp.load(ramp).net)
    return {file.name: file.read_bytes() for file in files}


def digest_of(files: Mapping[str, bytes]) -> str:
    """A short hash of files by name."""
    return digest(*(key.encode() + content for key, content in sorted(files.items())))


def digest(*parts: bytes) -> str:
    """A short hash."""
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16]

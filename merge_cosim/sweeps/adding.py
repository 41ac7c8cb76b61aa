"""Adding to a finished sweep: which settings must agree, and which tasks are still to be run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from merge_cosim.core.errors import UserError
from merge_cosim.results.store import ResultFolder
from merge_cosim.sweeps.task import Task

SAME = ("versions", "world", "seed", "source")
"""What must be the same as in the sweep before."""
NAMED = ("parameters", "components", "models", "ramps", "scenarios", "plugins")
"""What may grow, while each entry of the same name must be the same."""
NAMES = ("scenario", "variation", "method", "model")
"""What names a task."""
GROWING = ("grid", "random")
"""Kinds of encounters of which a sweep may get more: a case is its initial state, which can be compared."""
STATES = {
    "host_station_0_m": "host_station",
    "host_speed_0": "host_speed",
    "merging_station_0_m": "merging_station",
    "merging_speed_0": "merging_speed",
}
"""Columns of the initial states, and the encounters' attributes that they hold."""


def joined(before: Mapping[str, Any], new: dict[str, Any], against: str | None, folder: Path) -> dict[str, Any]:
    """The identity of a sweep together with what is added to it, as if both had been run as one.

    Args:
        before: The manifest of the sweep before.
        new: The identity of what is added.
        against: The method to compare with, if another than before.
        folder: Its folder, for messages.

    Raises:
        UserError: Settings, scenarios, versions or other inputs differ.
    """
    changed = [key for key in SAME if before.get(key) != new[key]]
    changed += [f"{key} {name}" for key in NAMED for name in _unlike(before[key], new[key])]
    kinds = {name: scenario["encounters"]["kind"] for name, scenario in new["scenarios"].items()}
    cases = _unlike(before["encounters"], new["encounters"])
    changed += [f"cases of {name}" for name in cases if kinds[name] not in GROWING]
    for settings, parameters in ((before["settings"], new["parameters"]), (new["settings"], before["parameters"])):
        changed += [f"--set {name}" for name in _unset(settings, parameters)]
    if changed:
        raise UserError(
            f"{folder}: --add needs the settings of the sweep that it holds, and these are others: "
            f"{', '.join(dict.fromkeys(changed))}; choose another --out"
        )
    variations = {name: dict.fromkeys(values) for name, values in before["variations"]}
    for name, values in new["variations"]:
        variations[name] = variations.get(name, {}) | dict.fromkeys(values)
    return {
        **new,
        **{key: {**before[key], **new[key]} for key in (*NAMED, "settings", "encounters")},
        "methods": sorted({*before["methods"], *new["methods"]}),
        "variations": [[name, list(values)] for name, values in variations.items()],
        "against": against or before["against"],
    }


def missing(tasks: Sequence[Task], folder: ResultFolder) -> Iterator[Task]:
    """The parts of some tasks whose rows a reopened folder does not hold.

    Raises:
        UserError: A case of the same name has another initial state.
    """
    scenes = {tuple(scene[name] for name in NAMES) for scene in folder.parts.scenes()}
    for task in tasks:
        pairs = task.cases.encounters
        if pairs is None:
            if tuple(task.names[name] for name in NAMES) not in scenes:
                yield task
            continue
        rows = folder.parts.before(task.scenario.name, task.variation, ["case", "method", "model", *STATES]).to_pandas()
        starts = rows.drop_duplicates("case").set_index("case")
        common = np.flatnonzero(np.isin(pairs.case, starts.index.to_numpy(dtype=str)))
        for column, name in STATES.items():
            stored = starts.loc[pairs.case[common], column].to_numpy(dtype=float)
            other = np.flatnonzero(stored != getattr(pairs, name)[common])
            if len(other):
                raise UserError(
                    f"{folder.path}: --add: case '{pairs.case[common[other[0]]]}' of scenario {task.scenario.name} "
                    f"begins otherwise there; choose another --out"
                )
        own = rows[(rows["method"] == task.method.name) & (rows["model"] == task.names["model"])]
        left = np.flatnonzero(~np.isin(pairs.case, own["case"].to_numpy(dtype=str)))
        if len(left):
            yield task if len(left) == len(pairs) else task.take(left)


def _unlike(before: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Names of the entries that are in both and differ."""
    return [name for name in new if name in before and _compared(before[name]) != _compared(new[name])]


def _compared(entry: Any) -> Any:
    """What must be the same; of a scenario that may get more cases, all but its encounters."""
    encounters = entry.get("encounters") if isinstance(entry, dict) else None
    if isinstance(encounters, dict) and encounters["kind"] in GROWING:
        return {name: value for name, value in entry.items() if name != "encounters"}
    return entry


def _unset(settings: Mapping[str, str], parameters: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Settings of components that some methods do not share."""
    for name, value in settings.items():
        for method, own in parameters.items():
            if name in own and f" {name}=" not in method and not _same(value, own[name]):
                yield f"{name}={value}"


def _same(text: str, value: Any) -> bool:
    try:
        return float(text) == float(value)
    except (TypeError, ValueError):
        return text == str(value)

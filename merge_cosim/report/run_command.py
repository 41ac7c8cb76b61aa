"""The command that runs a single case of a result folder."""

from __future__ import annotations

import shlex
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

from merge_cosim.ngsim.data import find_data
from merge_cosim.simulation.worlds.traffic import TRAFFIC
from merge_cosim.sweeps.plan import default_model


def run_command(row: Mapping[Hashable, Any], manifest: Mapping[str, Any]) -> str:
    """`merge-cosim run ...` with the settings that the row was made with."""
    command = manifest["command"]
    files = {Path(spec).stem: spec for spec in command["scenarios"]}
    words = ["merge-cosim", "run", files.get(row["scenario"], row["scenario"]), "--case", row["case"]]
    words += ["--method", row["method"]]
    settings = {**manifest["settings"], **dict([row["variation"].split("=", 1)] if row["variation"] else [])}
    for name, value in settings.items():
        if _reaches(name, row, manifest):
            words += ["--set", f"{name}={value}"]
    if row["model"] and row["model"] != default_model(row["source"]):
        words += ["--model", row["model"]]
    if manifest["seed"]:
        words += ["--seed", str(manifest["seed"])]
    if manifest["world"] != "sumo":
        words += ["--world", manifest["world"]]
    if manifest["source"]:
        words += ["--source", manifest["source"]]
    needs_data = row["source"] in ("ngsim", "recorded", "surrogate", TRAFFIC) and manifest["source"] != "surrogate"
    if needs_data and command["data"] and find_data(None) != Path(command["data"]):
        words += ["--data", command["data"]]
    for name in manifest["plugins"]:
        words += ["--plugin", command.get("plugins", {}).get(name, name)]
    return shlex.join(words)


def _reaches(name: str, row: Mapping[Hashable, Any], manifest: Mapping[str, Any]) -> bool:
    """Whether a setting is of the scenario or of the row's method; one of another method would be refused."""
    own = " ".join(filter(None, (row["method"], row["variation"])))
    others = {key for parameters in manifest["parameters"].values() for key in parameters}
    return name not in others or name in manifest["parameters"].get(own, {})

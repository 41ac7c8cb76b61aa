"""Runs the real command in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

SMALL = """
title = "A coarse grid"
ramp = "designed"

[encounters]
kind = "grid"
host_offset = { from = -4, to = 4, step = 4 }
host_speed = { from = 5, to = 25, step = 5 }
merging_speed = { from = 5, to = 25, step = 5 }

[merging]
model = "designed"
"""


def merge_cosim(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `merge-cosim` and return what it printed."""
    command = [sys.executable, "-m", "merge_cosim.cli.main", *map(str, arguments)]
    settings = {name: value for name, value in os.environ.items() if name != "MERGE_COSIM_DATA"} | environment
    return subprocess.run(command, cwd=cwd, env=settings, capture_output=True, text=True, timeout=300, check=False)


def small_scenario(folder: Path) -> Path:
    """Write a scenario of 75 cases."""
    file = folder / "small.toml"
    file.write_text(SMALL)
    return file


def summary(folder: Path) -> dict[str, dict[str, object]]:
    """The summary rows of a result folder by method."""
    return {row["method"]: row for row in json.loads((folder / "summary.json").read_text())}

"""Runs the real command: in a process of its own or, for what ends before anything is run, in this one."""

import contextlib
import io
import json
import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

from merge_cosim.cli.main import main

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
    settings = without_data() | environment
    return subprocess.run(command, cwd=cwd, env=settings, capture_output=True, text=True, timeout=300, check=False)


def refused(*arguments: object, cwd: Path) -> str:
    """The one line on standard error with which `merge-cosim` refuses a mistake, sooner than a process would."""
    printed, told = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd),
        patch.object(sys, "argv", ["merge-cosim", *map(str, arguments)]),
        patch.dict(os.environ, without_data(), clear=True),
        contextlib.redirect_stdout(printed),
        contextlib.redirect_stderr(told),
    ):
        try:
            main()
        except SystemExit as end:
            status = end.code
    assert (status, printed.getvalue()) == (2, ""), told.getvalue()
    (line,) = told.getvalue().strip().splitlines()
    return line


def without_data() -> dict[str, str]:
    """The environment without the real data."""
    return {name: value for name, value in os.environ.items() if name != "MERGE_COSIM_DATA"}


def small_scenario(folder: Path) -> Path:
    """Write a scenario of 75 cases."""
    file = folder / "small.toml"
    file.write_text(SMALL)
    return file


def summary(folder: Path) -> dict[str, dict[str, object]]:
    """The summary rows of a result folder by method."""
    return {row["method"]: row for row in json.loads((folder / "summary.json").read_text())}

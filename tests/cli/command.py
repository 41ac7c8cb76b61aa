"""Runs the real command: in this process or, where that is the point of a test, in one of its own."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO
from unittest.mock import patch

from merge_cosim.cli.main import main
from merge_cosim.controllers.base import controllers
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.sensors.base import sensors

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

COMMAND = (sys.executable, "-m", "merge_cosim")


def merge_cosim(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `merge-cosim` in this process and return its status and what it, and SUMO, printed.

    Worker processes are started only where `--jobs` asks for them. What plugins register is forgotten afterwards.
    """
    words = ["merge-cosim", *map(str, arguments)]
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.chdir(cwd))
        stack.enter_context(patch.object(sys, "argv", words))
        stack.enter_context(patch.object(os, "cpu_count", lambda: 1))
        stack.enter_context(patch.dict(os.environ, without_data() | environment, clear=True))
        for registry in (estimators, controllers, merging_cars, sensors):
            registry.names()  # our own classes are registered from now on
            stack.enter_context(patch.dict(registry._classes))
        stack.enter_context(patch.object(sys, "unraisablehook", sys.unraisablehook))
        for number in (signal.SIGINT, signal.SIGTERM):
            stack.callback(signal.signal, number, signal.getsignal(number))
        output, error = (stack.enter_context(_written(*stream)) for stream in (("stdout", 1), ("stderr", 2)))
        try:
            main()
        except SystemExit as end:
            status = int(end.code or 0)
        for plugin in [name for name in sys.modules if name.startswith("merge_cosim_plugin_")]:
            del sys.modules[plugin]
        for file in (output, error):
            file.seek(0)
        return subprocess.CompletedProcess(words, status, output.read(), error.read())


@contextlib.contextmanager
def _written(name: str, descriptor: int) -> Iterator[TextIO]:
    """A file that takes what Python writes to a standard stream and SUMO to its descriptor."""
    kept = os.dup(descriptor)
    try:
        with tempfile.TemporaryFile("w+", encoding="utf-8", buffering=1) as file, patch.object(sys, name, file):
            os.dup2(file.fileno(), descriptor)
            yield file
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)


def run_process(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `merge-cosim` in a process of its own and return its status and what it printed."""
    command = [*COMMAND, *map(str, arguments)]
    settings = without_data() | environment
    return subprocess.run(command, cwd=cwd, env=settings, capture_output=True, text=True, timeout=300, check=False)


def refused(*arguments: object, cwd: Path) -> str:
    """The one line on standard error with which `merge-cosim` refuses a mistake."""
    done = merge_cosim(*arguments, cwd=cwd)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    (line,) = done.stderr.strip().splitlines()
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

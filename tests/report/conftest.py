"""One small real sweep for all tests of the report, made through the command line."""

import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from merge_cosim.cli.main import main

SCENARIO = """
title = "A coarse grid"
about = "Twenty-seven cases."
ramp = "designed"

[encounters]
kind = "grid"
host_offset = { from = -5, to = 5, step = 5 }
host_speed = { from = 5, to = 25, step = 10 }
merging_speed = { from = 5, to = 25, step = 10 }

[merging]
model = "designed"
ahead = "clear"
"""


@pytest.fixture(scope="session")
def command() -> Callable[..., int]:
    """Run `merge-cosim` with some words; returns the exit status."""

    def run(*words: object) -> int:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", ["merge-cosim", *map(str, words)])
            with pytest.raises(SystemExit) as ended:
                main()
        return int(ended.value.code or 0)

    return run


@pytest.fixture(scope="session")
def swept(tmp_path_factory: pytest.TempPathFactory, command: Callable[..., int]) -> Path:
    """Result folder of three methods and a reference on a coarse grid, with its report."""
    folder = tmp_path_factory.mktemp("report")
    scenario = folder / "designed-2.toml"  # the name that the papers' figures go with
    scenario.write_text(SCENARIO, encoding="utf-8")
    methods = [word for name in ("acc", "slot", "always-go", "pgm-time") for word in ("--method", name)]
    vary = ("--vary", "merging.ahead=clear,any", "--vary", "test.horizon=1:3:2")
    assert command("sweep", scenario, *methods, *vary, "--jobs", 1, "--out", folder / "out") == 0
    assert command("report", folder / "out") == 0
    return folder / "out"


CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")  # playwright runs once at a time in a process
def browser() -> Iterator[Any]:
    """A Chromium that playwright drives; tests that need it are skipped where either is absent."""
    sync_api = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    with sync_api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])

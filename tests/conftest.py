"""What the tests share: the real data where it is at hand, and a cache of their own."""

import gc
import os
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest

for library in ("OMP", "OPENBLAS"):  # before numpy is imported: the tests fill all cores, threads only cost time
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
# they start many processes, each of which would otherwise compile every module anew
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
gc.disable()  # until the tests are collected: what is read until then stays to the end


COMPILING = (
    "sweep",
    "designed-random",
    "--method",
    "interactive,dbn-pf,ipcb",
    "--set",
    "encounters.count=1",
    "--traces",
    "0",
)


def pytest_configure(config: pytest.Config) -> None:
    """Two processes of tests share two cores with SUMO, so no example has a deadline."""
    from hypothesis import settings

    settings.register_profile("unhurried", deadline=None)
    settings.load_profile("unhurried")
    if config.getoption("numprocesses", None) and not hasattr(config, "workerinput"):
        compile_kernels(config)


def compile_kernels(config: pytest.Config) -> None:
    """Compile the kernels once, while the processes of tests start, each of which would compile them otherwise."""
    folder = tempfile.TemporaryDirectory()
    config.add_cleanup(folder.cleanup)
    command = [sys.executable, "-m", "merge_cosim", *COMPILING, "--jobs", "1", "--world", "closed-form", "--out", "out"]
    quiet = subprocess.DEVNULL
    config.add_cleanup(subprocess.Popen(command, cwd=folder.name, stdout=quiet, stderr=quiet).wait)


def pytest_collection_finish() -> None:
    """The collector need not search modules and tests again and again, nor after every few objects."""
    gc.freeze()
    gc.set_threshold(50_000)
    gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Every other process of tests goes through the folders backwards: each compiles half of the files, not all."""
    report = yield
    if isinstance(collector, pytest.Directory) and os.environ.get("PYTEST_XDIST_WORKER", "gw0")[-1] in "13579":
        report.result.reverse()
    return report


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow tests come first where several processes share the tests, so that they end together; all in one order."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: (item.get_closest_marker("slow") is None, str(item.path)))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder with real NGSIM files; tests that need it are skipped where it is absent."""
    folder = os.environ.get("MERGE_COSIM_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("real NGSIM data not at hand: set MERGE_COSIM_DATA")
    return Path(folder)


@pytest.fixture(scope="session")
def mona_dir() -> Path:
    """The folder with the merge of the MONA data set; tests that need it are skipped where it is absent."""
    folder = os.environ.get("MERGE_COSIM_MONA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("MONA data not at hand: set MERGE_COSIM_MONA")
    return Path(folder)


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep the user's cache out of the tests; all processes of a run share one, and one that is set already is kept."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    os.environ.setdefault("MERGE_COSIM_CACHE", str(shared / "cache"))


@pytest.fixture(scope="session", autouse=True)
def short_surrogate() -> None:
    """One recording of three minutes of each site, by SUMO as ever, in place of three of fifteen."""
    from merge_cosim.ngsim.surrogate.recipe import RECIPES

    for name, recipe in RECIPES.items():
        RECIPES[name] = replace(recipe, seeds=recipe.seeds[:1], duration=180.0)


def own_registries() -> Iterator[None]:
    """What a test, or what its module shares, registers is gone afterwards: others may use the name, or list all."""
    from merge_cosim.controllers.base import controllers
    from merge_cosim.estimators.base import estimators
    from merge_cosim.merging_cars.base import merging_cars
    from merge_cosim.sensors.base import sensors

    with ExitStack() as stack:
        for registry in (estimators, controllers, merging_cars, sensors):
            registry.names()  # ours are registered from now on
            stack.enter_context(patch.dict(registry._classes))
        yield


registries_of_module = pytest.fixture(scope="module", autouse=True, name="registries_of_module")(own_registries)
registries_of_test = pytest.fixture(autouse=True, name="registries_of_test")(own_registries)

"""What the tests share: the real data where it is at hand, and a cache of their own."""

import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest

for library in ("OMP", "OPENBLAS"):  # before numpy is imported: the tests fill all cores, threads only cost time
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
# they start many processes, each of which would otherwise compile every module anew
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def pytest_configure() -> None:
    """Two processes of tests share two cores with SUMO, so no example has a deadline."""
    from hypothesis import settings

    settings.register_profile("unhurried", deadline=None)
    settings.load_profile("unhurried")


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
    """One recording of five minutes of each site, by SUMO as ever, in place of three of fifteen."""
    from merge_cosim.ngsim.surrogate.recipe import RECIPES

    for name, recipe in RECIPES.items():
        RECIPES[name] = replace(recipe, seeds=recipe.seeds[:1], duration=300.0)

"""The README: every command and every line of Python in it works. How they are made short is said in `pages`."""

import shutil
from pathlib import Path

import pytest
from pages import GRID, ROOT, follow, run

from merge_cosim.ngsim.sites import site
from merge_cosim.ngsim.surrogate.surrogate import surrogate_folder
from merge_cosim.results.store import ResultFolder

README = ROOT / "README.md"


@pytest.mark.slow
def test_every_command_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    shutil.copytree(surrogate_folder(site("us101")), tmp_path / "DIR")  # in the format of the real files
    coarse = {name: float(step) for name, _, step in (each.partition("=") for each in GRID)}
    names = follow(README, tmp_path, {"jobs=2": f"jobs=1, settings={coarse}"})
    assert set(ResultFolder(tmp_path / "out/first").results().to_pandas()["method"]) == {"acc", "pgm", "cautious"}
    assert (tmp_path / "out/demo/report.html").is_file()
    assert (tmp_path / "out.html").is_file()
    assert len(names["run"].trace)


@pytest.mark.parametrize(
    "line", ["merge-cosim ngsim fetch", "merge-cosim run designed-2 --gooey", "make demmo", "pip install 'x[gim]'"]
)
def test_a_command_that_is_not_there_fails(tmp_path: Path, line: str) -> None:
    assert run(line, tmp_path).returncode != 0

"""The page on parts of one's own: what stands there works."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

PAGE = Path(__file__).parent.parent / "docs" / "extending.md"
COARSE = "encounters.host_speed.step=8", "encounters.merging_speed.step=8", "encounters.host_offset.step=5"


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with the page's Python files."""
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        name = block.partition("\n")[0].removeprefix("# ")
        (tmp_path / name).write_text(block, encoding="utf-8")
    return tmp_path


def run(folder: Path, *words: str, **more: str) -> str:
    environment = os.environ | more
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def sweep(folder: Path, *words: str, **more: str) -> set[str]:
    coarse = [word for value in COARSE for word in ("--set", value)]
    command = ("-m", "merge_cosim.cli.main", "sweep", "designed-2", *coarse, *words, "--out", "out", "--json")
    run(folder, *command, **more)
    return set(pq.read_table(folder / "out/results.parquet")["method"].to_pylist())


def test_an_estimator_from_a_file(files):
    assert "cautious" in run(files, "-m", "merge_cosim.cli.main", "methods", "--plugin", "my.py", "--json")
    words = ("--plugin", "my.py", "--method", "cautious", "--method", "acc", "--set", "cautious.lead=5")
    assert sweep(files, *words, "--jobs", "2") == {"cautious", "acc"}
    assert Path(run(files, "-m", "merge_cosim.cli.main", "report", "out").strip()).name == "report.html"
    assert "cautious" in (files / "out/report.html").read_text(encoding="utf-8")


def test_a_controller_from_a_file(files):
    assert sweep(files, "--plugin", "my_controller.py", "--method", "acc+gentle", "--jobs", "1") == {"acc+gentle"}


def test_an_installed_entry_point(files):
    facts = files / "site" / "my_package-1.0.dist-info"
    facts.mkdir(parents=True)
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n", encoding="utf-8")
    (facts / "entry_points.txt").write_text("[merge_cosim.estimator]\ncautious = my\n", encoding="utf-8")
    (files / "my.py").rename(files / "site" / "my.py")
    path = os.pathsep.join(filter(None, [str(files / "site"), os.environ.get("PYTHONPATH", "")]))
    assert sweep(files, "--method", "cautious", "--jobs", "2", PYTHONPATH=path) == {"cautious"}


@pytest.mark.slow
def test_a_study_from_python(files):
    printed = run(files, "study.py")
    assert "cautious" in printed
    assert (files / "out/study/report.html").is_file()

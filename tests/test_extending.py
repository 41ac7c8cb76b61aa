"""The page on parts of one's own: what stands there works."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from command import COMMAND, merge_cosim

PAGE = Path(__file__).parent.parent / "docs" / "extending.md"
COARSE = "encounters.host_speed.step=12", "encounters.merging_speed.step=12", "encounters.host_offset.step=5"


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with the page's Python files."""
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        name = block.partition("\n")[0].removeprefix("# ")
        (tmp_path / name).write_text(block, encoding="utf-8")
    return tmp_path


def printed(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 0, done.stderr
    return done.stdout


def in_a_process(folder: Path, *words: str, **more: str) -> str:
    return printed(
        subprocess.run(words, cwd=folder, env=os.environ | more, capture_output=True, text=True, check=False)
    )


def sweep_words(*words: str) -> tuple[str, ...]:
    coarse = [word for value in COARSE for word in ("--set", value)]
    return ("sweep", "designed-2", *coarse, *words, "--out", "out", "--overwrite", "--json")


def methods(folder: Path) -> set[str]:
    return set(pq.read_table(folder / "out/results.parquet")["method"].to_pylist())


def test_an_estimator_from_a_file(files):
    assert "cautious" in printed(merge_cosim("methods", "--plugin", "my.py", "--json", cwd=files))
    words = ("--plugin", "my.py", "--method", "cautious", "--method", "acc", "--set", "cautious.lead=5")
    printed(merge_cosim(*sweep_words(*words), cwd=files))
    assert methods(files) == {"cautious", "acc"}
    assert Path(printed(merge_cosim("report", "out", cwd=files)).strip()).name == "report.html"
    assert "cautious" in (files / "out/report.html").read_text(encoding="utf-8")


def test_a_controller_from_a_file(files):
    printed(merge_cosim(*sweep_words("--plugin", "my_controller.py", "--method", "acc+gentle"), cwd=files))
    assert methods(files) == {"acc+gentle"}


def test_a_merging_car_from_a_file(files):
    words = ("sweep", "shifted-idm", "--plugin", "my_merging_car.py", "--method", "acc", "--out", "out", "--overwrite")
    words += ("--json", "--set", "encounters.count=20", "--set", "merging.model=hurrying", "--set")
    slow, fast = (printed(merge_cosim(*words, f"merging.gain={gain}", cwd=files)) for gain in (0, 2))
    assert json.loads(slow)["summary"][0]["delay_s"] != json.loads(fast)["summary"][0]["delay_s"]


def test_a_sensor_from_a_file(files):
    words = ("--plugin", "my_sensor.py", "--method", "acc", "--set", "sensing.model=near")
    far, near = (
        printed(merge_cosim(*sweep_words(*words, "--set", f"sensing.reach={reach}"), cwd=files)) for reach in (500, 0)
    )
    assert json.loads(far)["summary"][0]["delay_s"] != json.loads(near)["summary"][0]["delay_s"]


def test_an_installed_entry_point(files):
    facts = files / "site" / "my_package-1.0.dist-info"
    facts.mkdir(parents=True)
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n", encoding="utf-8")
    (facts / "entry_points.txt").write_text("[merge_cosim.estimator]\ncautious = my\n", encoding="utf-8")
    (files / "my.py").rename(files / "site" / "my.py")
    path = os.pathsep.join(filter(None, [str(files / "site"), os.environ.get("PYTHONPATH", "")]))
    in_a_process(files, *COMMAND, *sweep_words("--method", "cautious", "--jobs", "2"), PYTHONPATH=path)
    assert methods(files) == {"cautious"}


@pytest.mark.slow
def test_a_study_from_python(files):
    study = files / "study.py"
    coarse = {name: float(step) for name, _, step in (value.partition("=") for value in COARSE)}
    text, changed = re.subn(r"\bjobs=2\b", f"settings={coarse!r}, jobs=1", study.read_text(encoding="utf-8"))
    assert changed == 1
    study.write_text(text, encoding="utf-8")
    assert "cautious" in in_a_process(files, sys.executable, "study.py")
    assert (files / "out/study/report.html").is_file()

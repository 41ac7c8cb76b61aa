"""Sweeps that are struck and go on; the long run is `python tools/faults.py --faults N --seed S`."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "faults.py"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_struck_sweeps_end_with_the_same_bytes(tmp_path: Path) -> None:
    words = ("--faults", "5", "--seed", "1", "--only", "kill,lose_worker,limit_files,damage")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(TOOL.parents[1]), *sys.path])}
    done = subprocess.run(
        [sys.executable, TOOL, *words], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert (found["faults"], found["same"], found["wrong"]) == (5, 5, 0)

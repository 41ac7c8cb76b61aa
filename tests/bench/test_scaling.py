"""What a command costs, measured from outside."""

import json
import subprocess
import sys

from merge_cosim.bench.scaling import MEASURE


def test_peak_memory_is_that_of_the_command_and_not_of_who_measures_it(tmp_path):
    held = b"x" * (300 * 2**20)
    cost, command = tmp_path / "cost.json", [sys.executable, "-c", "raise SystemExit(3)"]
    done = subprocess.run([sys.executable, "-I", "-S", "-c", MEASURE, str(cost), *command], check=False)
    assert done.returncode == 1
    cpu_s, peak = json.loads(cost.read_text())
    assert cpu_s > 0
    assert 0 < peak / (2**20 if sys.platform == "darwin" else 2**10) < 100 < len(held)

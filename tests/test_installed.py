"""What an installed wheel holds: laid out as pyproject.toml says, it finds its nets and scenarios from any folder."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_nets_and_scenarios_are_found_from_a_wheel(tmp_path):
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    site, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    elsewhere.mkdir()
    for package in wheel["packages"]:
        shutil.copytree(ROOT / package, site / package, ignore=shutil.ignore_patterns("__pycache__"))
    for source, target in wheel["force-include"].items():
        shutil.copytree(ROOT / source, site / target)

    def listed(*words: str) -> list[dict[str, str]]:
        command = [sys.executable, "-m", "merge_cosim", *words, "--json"]
        done = subprocess.run(
            command,
            cwd=elsewhere,
            env=os.environ | {"PYTHONPATH": str(site)},
            capture_output=True,
            text=True,
            check=True,
        )
        rows: list[dict[str, str]] = json.loads(done.stdout)
        return rows

    shipped = {file.stem for file in (ROOT / "scenarios").glob("*.toml")}
    assert {row["scenario"] for row in listed("scenarios")} == shipped
    nets = {file.parent.name for file in (ROOT / "sumo_nets").glob("*/ramp.toml")}
    assert {row["name"] for row in listed("ramp", "list")} == nets
    probe = "import merge_cosim, merge_cosim.core.files as f; print(merge_cosim.__file__, *map(f.shipped, "
    probe += "('sumo_nets', 'tools/bench')))"
    done = subprocess.run(
        [sys.executable, "-c", probe],
        cwd=elsewhere,
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert [Path(path).is_relative_to(site) for path in done.stdout.split()] == [True] * 3

"""Mutation score of the package's core: `python tools/mutation.py --sample N --seed S`, in a copy of the repository.

cosmic-ray changes one place of a module at a time (an operator, a number, a comparison, a branch) and runs the tests of
that module; a mutant that no test fails has survived. Only a random sample of all mutants is run, the same number for
each part of the core, with the share killed and its 95 % interval (Wilson).
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

from merge_cosim.results.statistics.rates import wilson

CORE = {
    "scoring": (
        ["scoring/scoring.py", "scoring/rules.py", "scoring/decisions.py"],
        [f"scoring/test_{name}.py" for name in ("scoring", "measures", "second_reading", "end_of")],
    ),
    "statistics": (
        ["results/statistics/rates.py", "results/statistics/verdict.py", "results/statistics/summary.py"],
        [f"results/test_{name}.py" for name in ("statistics", "summaries", "verdict")],
    ),
    "readers": (
        ["ngsim/clean.py", "ngsim/formats.py", "ngsim/table.py", "ngsim/rows.py", "ngsim/resample.py"],
        [f"ngsim/test_{name}.py" for name in ("cells", "formats", "read", "resample", "table", "own_recording")],
    ),
    "loop": (
        ["simulation/loop.py", "simulation/leader.py", "simulation/host_driver.py"],
        [f"simulation/test_{name}.py" for name in ("leader", "host_driver", "loop")],
    ),
}
"""Modules of each part, and the tests that must kill their mutants."""

CONFIG = """[cosmic-ray]
module-path = {modules}
timeout = 240.0
excluded-modules = []
test-command = "{python} -m pytest -x -q -p no:cacheprovider {tests}"
[cosmic-ray.distributor]
name = "local"
"""


def score(part: str, sample: int, seed: int, copy: Path) -> dict[str, object]:
    """Run a sample of the mutants of one part."""
    modules, tests = CORE[part]
    session, config = copy / f"{part}.sqlite", copy / f"{part}.toml"
    places = json.dumps([f"merge_cosim/{module}" for module in modules])
    files = " ".join(f"tests/{test}" for test in tests)
    config.write_text(CONFIG.format(modules=places, tests=files, python=sys.executable))
    run, own = [sys.executable, "-m", "cosmic_ray.cli"], os.environ | {"PYTHONPATH": str(copy)}
    subprocess.run([*run, "init", str(config), str(session)], cwd=copy, env=own, check=True)
    with sqlite3.connect(session) as base:
        every = base.execute("select job_id, module_path, operator_name, start_pos_row from mutation_specs").fetchall()
        meant = sorted(one for one in every if _meant(copy / one[1], one[3]))
        chosen = random.Random(f"{seed} {part}").sample(meant, min(sample, len(meant)))
        kept = {one[0] for one in chosen}
        for table in ("mutation_specs", "work_items"):
            base.executemany(
                f"delete from {table} where job_id = ?", [(one[0],) for one in every if one[0] not in kept]
            )
    subprocess.run([*run, "exec", str(config), str(session)], cwd=copy, env=own, check=True)
    with sqlite3.connect(session) as base:
        rows = base.execute(
            "select m.module_path, m.start_pos_row, m.operator_name, r.test_outcome from mutation_specs m "
            "join work_results r on r.job_id = m.job_id"
        ).fetchall()
    survived = sorted(f"{module}:{line} {operator}" for module, line, operator, end in rows if "SURVIVED" in str(end))
    return {"mutants": len(meant), "run": len(rows), "killed": len(rows) - len(survived), "survived": survived}


def _meant(module: Path, line: int) -> bool:
    """Whether a line is code that runs: not a type hint of a signature or a field, which no test can tell."""
    text = module.read_text().splitlines()[line - 1].strip()
    return "->" not in text and not (" | None" in text and ":" in text)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sample", type=int, default=25, help="mutants of each part")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="parts, with commas between")
    given = parser.parse_args()
    parts = [part for part in CORE if not given.only or part in given.only.split(",")]
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / "copy"
        ignored = shutil.ignore_patterns(".git", ".venv", "out", "*.sqlite", "__pycache__", ".hypothesis")
        shutil.copytree(Path(__file__).parents[1], copy, ignore=ignored)
        for part in parts:
            found[part] = score(part, given.sample, given.seed, copy)
            print(json.dumps({part: found[part]}), file=sys.stderr, flush=True)
    killed, run = (sum(int(str(one[name])) for one in found.values()) for name in ("killed", "run"))
    interval = [round(float(end), 1) for end in wilson(killed, run)]
    print(
        json.dumps(
            {"seed": given.seed, "run": run, "killed": killed, "interval_pct": interval, "parts": found}, indent=1
        )
    )


if __name__ == "__main__":
    main()

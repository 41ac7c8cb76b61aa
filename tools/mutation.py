"""Mutation score of the package's core: `python tools/mutation.py --sample N --seed S`, in a copy of the repository.

cosmic-ray changes one place of a module at a time (an operator, a number, a comparison, a branch) and runs the tests of
that module; a mutant that no test fails has survived. Only a random sample of all mutants is run, the same number for
each part of the core, with the share killed and its 95 % interval (Wilson).
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
from pathlib import Path

import pytest

LARGE = ("hypothesis", "pandas", "pyarrow.parquet", "scipy.stats", "sklearn.mixture")
"""What takes long to import: it is, once, for all mutants."""
CORE = {
    "scoring": (
        ["scoring/scoring.py", "scoring/rules.py", "scoring/decisions.py"],
        [f"scoring/test_{name}.py" for name in ("scoring", "measures", "second_reading", "end_of")],
    ),
    "statistics": (
        ["results/statistics/rates.py", "results/statistics/verdict.py", "results/statistics/summary.py"],
        [f"results/test_{name}.py" for name in ("summary_second_reading", "verdict", "statistics", "summaries")],
    ),
    "readers": (
        ["ngsim/clean.py", "ngsim/formats.py", "ngsim/table.py", "ngsim/rows.py", "ngsim/resample.py"],
        [f"ngsim/test_{name}.py" for name in ("cells", "formats", "read", "resample", "table", "own_recording")],
    ),
    "loop": (
        ["simulation/loop.py", "simulation/leader.py", "simulation/host_driver.py"],
        [f"simulation/test_{name}.py" for name in ("leader", "host_driver", "loop_records", "loop")],
    ),
}
"""Modules of each part, and the tests that must kill their mutants."""

LIMIT = 240
"""Longest time for the tests of one mutant [s]; a mutant that needs more is killed."""


def score(part: str, sample: int, seed: int) -> dict[str, object]:
    """Run a sample of the mutants of one part, in a copy of the repository, which is the current folder."""
    from cosmic_ray.commands import init
    from cosmic_ray.mutating import use_mutation
    from cosmic_ray.plugins import get_operator
    from cosmic_ray.work_db import use_db

    modules, tests = CORE[part]
    with use_db(f"{part}.sqlite") as base:
        init([Path("merge_cosim") / module for module in modules], base, {})
        every = [one.mutations[0] for one in base.work_items]
    meant = sorted(
        (one for one in every if _meant(Path(one.module_path), one.start_pos[0])),
        key=lambda one: (str(one.module_path), one.operator_name, one.occurrence),
    )
    chosen = random.Random(f"{seed} {part}").sample(meant, min(sample, len(meant)))
    files = [f"tests/{test}" for test in tests]
    if not _passes(files):
        raise SystemExit(f"{part}: the tests fail without any change")
    survived = []
    for number, one in enumerate(chosen):
        with use_mutation(one.module_path, get_operator(one.operator_name)(), one.occurrence) as (code, mutated):
            os.utime(one.module_path, (number, number))  # no two mutants share what Python has compiled
            if _passes(files):
                line = next(new for old, new in zip(code.split("\n"), mutated.split("\n"), strict=False) if old != new)
                survived.append(f"{one.module_path}:{one.start_pos[0]}: {line.strip()}")
    run = len(chosen)
    return {"mutants": len(meant), "run": run, "killed": run - len(survived), "survived": sorted(survived)}


def _passes(files: list[str]) -> bool:
    """Whether tests pass, in a process of their own that has the large libraries loaded, but not the package."""
    child = os.fork()
    if not child:
        os.setsid()
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        signal.alarm(LIMIT)
        os._exit(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *files]))
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return status == 0


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
        ignored = shutil.ignore_patterns(".*", "out", "*.sqlite", "__pycache__")
        shutil.copytree(Path(__file__).parents[1], copy, ignore=ignored)
        os.chdir(copy)
        sys.path.insert(0, str(copy))
        os.environ |= {"PYTHONPATH": str(copy), "MERGE_COSIM_CACHE": str(Path(scratch) / "cache")}
        for library in LARGE:
            importlib.import_module(library)
        for part in parts:
            found[part] = score(part, given.sample, given.seed)
            print(json.dumps({part: found[part]}), file=sys.stderr, flush=True)
        from merge_cosim.results.statistics.rates import wilson  # not before: each mutant loads the package anew
    killed, run = (sum(int(str(one[name])) for one in found.values()) for name in ("killed", "run"))
    interval = [round(float(end), 1) for end in wilson(killed, run)]
    print(
        json.dumps(
            {"seed": given.seed, "run": run, "killed": killed, "interval_pct": interval, "parts": found}, indent=1
        )
    )


if __name__ == "__main__":
    main()

"""How whole commands grow with cases, processes and methods, beside another version where asked."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from merge_cosim.core.errors import UserError
from merge_cosim.results.store import MANIFEST

SCENARIO, METHOD = "designed-random", "acc"
METHODS = ("acc", "slot", "pgm", "pgm-g", "fg", "fg-gmm", "ipcb", "dbn-pf")
COUNTS = (1, 2, 4, 8)
"""Of `METHODS`, growth over methods takes the first, the first two, and so on."""
START = "from merge_cosim.cli.main import main; main()"
MEASURE = """
import json, os, subprocess, sys
_, status, used = os.wait4(subprocess.Popen(sys.argv[2:]).pid, 0)
with open(sys.argv[1], "w") as file:
    json.dump([used.ru_utime + used.ru_stime, used.ru_maxrss], file)
sys.exit(os.waitstatus_to_exitcode(status) and 1)
"""
"""Runs a command and writes what it and its workers used. From a small process, as the peak memory that Linux counts
for a new process is never below that of the one that started it."""


def scaling(sizes: Sequence[int], processes: Sequence[int], rounds: int) -> list[dict[str, Any]]:
    """Run sweeps of the given sizes on the given numbers of processes, each by the real command, in turns.

    Returns:
        A row per size and number, that of the run with the median `run_s`: wall time, its parts, time per case [ms],
        processor time of the whole command, and the largest process's peak memory [MiB].
    """
    runs: dict[tuple[int, int], list[dict[str, Any]]] = {(cases, jobs): [] for cases in sizes for jobs in processes}
    for _ in range(rounds):
        for (cases, jobs), rows in runs.items():
            manifest, cost = run_sweep((*_cases(cases), "--method", METHOD, "--jobs", str(jobs)))
            rows.append(
                {
                    "cases": cases,
                    "processes": jobs,
                    **{name: manifest[name] for name in ("wall_s", "plan_s", "run_s", "store_s")},
                    "ms_per_case": round(1e3 * manifest["run_s"] / cases, 3),
                    "cpu_s": cost["cpu_s"],
                    "loop_ms_per_case": round(1e3 * manifest["loop_s"] / cases, 3),
                    "peak_mib": cost["peak_mib"],
                }
            )
    return [sorted(rows, key=lambda row: row["run_s"])[rounds // 2] for rows in runs.values()]


def methods_scaling(cases: int, rounds: int) -> list[dict[str, Any]]:
    """So many cases in the closed form with more and more methods, in one process: processor time of the command.

    Returns:
        A row per number of methods, with the median processor time [s].
    """
    times: dict[int, list[float]] = {count: [] for count in COUNTS}
    for _ in range(rounds):
        for count in COUNTS:
            names = ",".join(METHODS[:count])
            words = (*_cases(cases), "--method", names, "--world", "closed-form", "--jobs", "1")
            times[count].append(run_sweep(words)[1]["cpu_s"])
    return [{"methods": ", ".join(METHODS[:count]), "cpu_s": round(median(times[count]), 2)} for count in COUNTS]


def beside(checkout: Path, cases: int, rounds: int) -> dict[str, Any]:
    """Run one sweep in SUMO on one process by this version and by that of another checkout, in turns.

    Returns:
        Median processor time of the command and time in the loop of both [s], and this version's over the other's.
    """
    paths = {"this": Path(__file__).parents[2], "other": checkout.resolve()}
    words = (*_cases(cases), "--method", METHOD, "--jobs", "1")
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in paths}
    for _ in range(rounds):
        for name, path in paths.items():
            manifest, cost = run_sweep(words, {"PYTHONPATH": str(path)})
            found[name].append((cost["cpu_s"], manifest["loop_s"]))
    cpu = {name: median(one for one, _ in runs) for name, runs in found.items()}
    loop = {name: median(one for _, one in runs) for name, runs in found.items()}
    return {
        "command": "merge-cosim " + " ".join(words),
        "cpu_s": round(cpu["this"], 2),
        "other_cpu_s": round(cpu["other"], 2),
        "cpu_ratio": round(cpu["this"] / cpu["other"], 3),
        "loop_s": round(loop["this"], 2),
        "other_loop_s": round(loop["other"], 2),
        "loop_ratio": round(loop["this"] / loop["other"], 3),
    }


def _cases(cases: int) -> tuple[str, ...]:
    return ("sweep", SCENARIO, "--set", f"encounters.count={cases}")


def run_sweep(
    words: Sequence[str], variables: Mapping[str, str] | None = None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Run a sweep by the real command, in a process of its own.

    Returns:
        Its manifest, and the processor time [s] and peak memory [MiB] of the command with its workers.

    Raises:
        UserError: It fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        cost = Path(folder) / "cost.json"
        command = [sys.executable, "-c", START, *words, "--out", str(out)]
        with (Path(folder) / "log").open("w+") as log:
            environment = {**os.environ, **(variables or {})}
            measured = [sys.executable, "-I", "-S", "-c", MEASURE, str(cost), *command]
            if subprocess.run(measured, stdout=log, stderr=log, cwd=folder, env=environment, check=False).returncode:
                log.seek(0)
                raise UserError(f"bench: merge-cosim {' '.join(words)} failed: {log.read().strip().splitlines()[-1]}")
        manifest = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
        cpu_s, peak = json.loads(cost.read_text())
    return manifest, {
        "cpu_s": round(cpu_s, 2),
        "peak_mib": round(peak / (2**20 if sys.platform == "darwin" else 2**10)),
    }

"""How whole sweeps grow with cases and processes: time per case, and peak memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from merge_cosim.core.errors import UserError
from merge_cosim.results.store import MANIFEST

SCENARIO, METHOD = "designed-random", "acc"


def scaling(sizes: Sequence[int], processes: Sequence[int], rounds: int) -> list[dict[str, Any]]:
    """Run sweeps of the given sizes on the given numbers of processes, each by the real command, in turns.

    Returns:
        A row per size and number, that of the run with the median `run_s`: wall time, its parts, time per case [ms],
        processor time of the whole command, and the largest process's peak memory [MiB].
    """
    runs: dict[tuple[int, int], list[dict[str, Any]]] = {(cases, jobs): [] for cases in sizes for jobs in processes}
    for _ in range(rounds):
        for kind, rows in runs.items():
            rows.append(_sweep(*kind))
    return [sorted(rows, key=lambda row: row["run_s"])[rounds // 2] for rows in runs.values()]


def _sweep(cases: int, jobs: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        words = ("sweep", SCENARIO, "--method", METHOD, "--set", f"encounters.count={cases}", "--jobs", str(jobs))
        command = [sys.executable, "-m", "merge_cosim.cli.main", *words, "--out", str(out)]
        with (Path(folder) / "log").open("w+") as log:
            process = subprocess.Popen(command, stdout=log, stderr=log)
            _, status, used = os.wait4(process.pid, 0)  # its peak memory, and its workers'
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode:
                log.seek(0)
                raise UserError(f"bench: a sweep of {cases} cases failed: {log.read().strip().splitlines()[-1]}")
        manifest = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
    return {
        "cases": cases,
        "processes": jobs,
        "wall_s": manifest["wall_s"],
        "plan_s": manifest["plan_s"],
        "run_s": manifest["run_s"],
        "store_s": manifest["store_s"],
        "ms_per_case": round(1e3 * manifest["run_s"] / cases, 3),
        "cpu_s": round(used.ru_utime + used.ru_stime, 1),
        "loop_ms_per_case": round(1e3 * manifest["loop_s"] / cases, 3),
        "peak_mib": round(used.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)),
    }

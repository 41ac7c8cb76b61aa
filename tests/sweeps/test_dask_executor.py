"""The Dask executor on a real scheduler with two real worker processes, one of which is killed in mid-run."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from command import COMMAND, merge_cosim, run_process, small_scenario
from scene_files import small_scene

import merge_cosim as merge_cosim_package

pytest.importorskip("distributed", reason="dask.distributed is an extra: pip install 'merge-cosim[dask]'")

PLUGIN = """
from dataclasses import dataclass
from typing import ClassVar
import numpy as np
from merge_cosim.estimators.base import Estimator, estimators

@estimators.register
@dataclass(kw_only=True)
class Shipped(Estimator):
    name: ClassVar[str] = "shipped"

    def update(self, seen):
        return np.where(seen.host_station > seen.merging_station, -1.0, 1.0)
"""


@contextmanager
def cluster(folder, workers=2, threads=1, **environment):
    """A scheduler and worker processes without nannies, which would start a killed worker anew."""
    folder.mkdir()
    started = []
    here = os.environ | {"MERGE_COSIM_CACHE": str(folder / "cache")}

    def start(*words):
        log = (folder / f"{len(started)}.log").open("w")
        command = [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]]
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, env=here | environment)
        started.append(process)
        return process, folder / f"{len(started) - 1}.log"

    try:
        _, log = start("dask_scheduler", "--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--no-jupyter")
        address = None
        for _ in range(300):
            if found := re.search(r"Scheduler at:\s+(tcp://\S+)", log.read_text()):
                address = found[1]
                break
            time.sleep(0.1)
        assert address, log.read_text()
        options = ("--nthreads", str(threads), "--no-nanny", "--no-dashboard")
        yield address, [start("dask_worker", address, *options)[0] for _ in range(workers)]
    finally:
        for process in started:
            process.kill()
            process.wait(20)


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_bytes_of_one_process(tmp_path):
    (tmp_path / "shipped.py").write_text(PLUGIN)
    ramp = merge_cosim("ramp", "new", "mine", "--out", "ramps", cwd=tmp_path)
    assert ramp.returncode == 0, ramp.stderr
    arguments = (
        *("sweep", "designed-random", "--set", "encounters.count=2000", "--set", "ramp=ramps/mine"),
        *("--method", "pgm", "--method", "shipped", "--plugin", "shipped.py"),
    )
    alone = merge_cosim(*arguments, "--out", "alone", "--jobs", 1, cwd=tmp_path)
    assert alone.returncode == 0, alone.stderr
    with cluster(tmp_path / "cluster") as (address, workers):
        command = [*COMMAND, *map(str, arguments), "--dask", address, "--out", "there"]
        sweep = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 120
        while not list(tmp_path.glob("there/parts/*.parquet")) and time.monotonic() < deadline:
            time.sleep(0.02)
        workers[0].send_signal(signal.SIGKILL)
        parts = len(list(tmp_path.glob("there/parts/*.parquet")))
        assert 0 < parts < 4  # in mid-run, and rows had come back by then
        _, error = sweep.communicate(timeout=240)
        assert sweep.returncode == 0, error
    assert (tmp_path / "there/results.parquet").read_bytes() == (tmp_path / "alone/results.parquet").read_bytes()
    assert json.loads((tmp_path / "there/manifest.json").read_text())["command"]["dask"] == address


@pytest.mark.slow
def test_workers_with_several_threads_are_refused(tmp_path):
    with cluster(tmp_path / "cluster", workers=1, threads=2) as (address, _):
        done = run_process("sweep", small_scenario(tmp_path), "--method", "acc", "--dask", address, cwd=tmp_path)
    assert done.returncode == 2
    assert "2 threads" in done.stderr
    assert "--nthreads 1" in done.stderr


@pytest.mark.slow
def test_a_worker_with_another_checkout_of_the_same_version_is_refused(tmp_path):
    other = tmp_path / "other" / "merge_cosim"
    shutil.copytree(Path(merge_cosim_package.__file__).parent, other, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "core" / "units.py").open("a") as file:
        file.write("# edited\n")
    with cluster(tmp_path / "cluster", workers=1, PYTHONPATH=str(other.parent)) as (address, _):
        done = run_process("sweep", small_scenario(tmp_path), "--method", "acc", "--dask", address, cwd=tmp_path)
    assert done.returncode == 2
    assert re.search(r"worker \S+ has merge-cosim's source [0-9a-f]{16} instead of [0-9a-f]{16}", done.stderr)
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow
def test_a_local_cluster_gives_the_same_bytes(tmp_path):
    scenarios = small_scenario(tmp_path), small_scene(tmp_path)
    for out, run, where in (("here", merge_cosim, ()), ("there", run_process, ("--dask", "local", "--jobs", 2))):
        done = run("sweep", *scenarios, "--method", "pgm", *where, "--out", out, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr
    for name in ("results.parquet", "scenes.csv", "notes.csv"):
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes(), name


def test_no_scheduler_is_one_line(tmp_path):
    done = run_process("sweep", small_scenario(tmp_path), "--dask", "tcp://127.0.0.1:9", cwd=tmp_path)
    assert done.returncode == 2
    assert "no scheduler answers there" in done.stderr.splitlines()[-1]
    assert len(done.stderr.strip().splitlines()) == 1


def test_without_dask_installed_there_is_one_line(tmp_path):
    (tmp_path / "distributed.py").write_text("raise ImportError('hidden by the test')")
    path = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    done = run_process("sweep", small_scenario(tmp_path), "--dask", "local", cwd=tmp_path, PYTHONPATH=path)
    assert done.returncode == 2
    assert "pip install 'merge-cosim[dask]'" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_other_versions_are_refused():
    from merge_cosim.core.errors import UserError
    from merge_cosim.sweeps.chunks import cut
    from merge_cosim.sweeps.dask_executor import WorkerFiles, run_shipped
    from merge_cosim.sweeps.identity import software
    from merge_cosim.sweeps.plan import SweepRequest, plan
    from merge_cosim.sweeps.shipping import pack

    batch = next(cut(plan(SweepRequest(["designed-random"], ["acc"])))).task()
    worker_files = WorkerFiles(software() | {"libsumo": "0.1"}, {}, "designed", {})
    with pytest.raises(UserError, match=r"libsumo .* instead of 0\.1"):
        run_shipped(pack(batch), worker_files)

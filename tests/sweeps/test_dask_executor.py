"""The Dask executor on a real scheduler with two real worker processes, one of which is killed in mid-run."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest
from command import merge_cosim, refused, small_scenario
from scene_files import small_scene

import merge_cosim as merge_cosim_package
from merge_cosim.sweeps import dask_executor
from merge_cosim.sweeps.cases import PairCases

MISSING = "dask.distributed is an extra: pip install 'merge-cosim[dask]'"
pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason=MISSING)

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


def started(folder, *words, **environment):
    """A part of a cluster in a process of its own, and its log."""
    log = folder / f"{words[0]}.log"
    here = os.environ | {"MERGE_COSIM_CACHE": str(folder / "cache")} | environment
    with log.open("w") as file:
        command = [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]]
        return subprocess.Popen(command, stdout=file, stderr=file, cwd=folder, env=here), log


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """The address of a scheduler."""
    options = ("--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--no-jupyter")
    process, log = started(tmp_path_factory.mktemp("scheduler"), "dask_scheduler", *options)
    try:
        until = time.monotonic() + 30
        while not (found := re.search(r"Scheduler at:\s+(tcp://\S+)", log.read_text())):
            assert time.monotonic() < until, log.read_text()
            time.sleep(0.1)
        yield found[1]
    finally:
        process.kill()
        process.wait(20)


@contextmanager
def workers(scheduler, folder, count=1, threads=1, **environment):
    """Worker processes without nannies, which would start a killed worker anew."""
    folder.mkdir()
    options = ("--nthreads", str(threads), "--no-nanny", "--no-dashboard")
    processes = [started(folder, "dask_worker", scheduler, *options, **environment)[0] for _ in range(count)]
    try:
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.wait(20)


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_bytes_of_one_process(tmp_path, scheduler, monkeypatch):
    (tmp_path / "shipped.py").write_text(PLUGIN)
    ramp = merge_cosim("ramp", "new", "mine", "--out", "ramps", cwd=tmp_path)
    assert ramp.returncode == 0, ramp.stderr
    monkeypatch.setattr(PairCases, "most", 60)  # many small chunks
    arguments = (
        *("sweep", "designed-random", "--set", "encounters.count=360", "--set", "ramp=ramps/mine"),
        *("--method", "pgm", "--method", "shipped", "--plugin", "shipped.py"),
    )
    alone = merge_cosim(*arguments, "--out", "alone", "--jobs", 1, cwd=tmp_path)
    assert alone.returncode == 0, alone.stderr
    finished = []

    def kill_when_rows_are_there():
        until = time.monotonic() + 120
        while not finished and time.monotonic() < until:
            time.sleep(0.005)
            finished.extend(tmp_path.glob("there/parts/*.parquet"))
        lost.send_signal(signal.SIGKILL)

    with workers(scheduler, tmp_path / "workers", count=2) as (lost, _):
        killer = threading.Thread(target=kill_when_rows_are_there)
        killer.start()
        there = merge_cosim(*arguments, "--dask", scheduler, "--out", "there", cwd=tmp_path)
        killer.join()
    assert there.returncode == 0, there.stderr
    assert 0 < len(finished) < 12  # in mid-run, and rows had come back by then
    assert (tmp_path / "there/results.parquet").read_bytes() == (tmp_path / "alone/results.parquet").read_bytes()
    assert json.loads((tmp_path / "there/manifest.json").read_text())["command"]["dask"] == scheduler


@pytest.mark.slow
def test_workers_with_several_threads_are_refused(tmp_path, scheduler):
    with workers(scheduler, tmp_path / "workers", threads=2):
        done = merge_cosim("sweep", small_scenario(tmp_path), "--method", "acc", "--dask", scheduler, cwd=tmp_path)
    assert done.returncode == 2
    assert "2 threads" in done.stderr
    assert "--nthreads 1" in done.stderr


@pytest.mark.slow
def test_a_worker_with_another_checkout_of_the_same_version_is_refused(tmp_path, scheduler):
    other = tmp_path / "other" / "merge_cosim"
    shutil.copytree(Path(merge_cosim_package.__file__).parent, other, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "core" / "units.py").open("a") as file:
        file.write("# edited\n")
    with workers(scheduler, tmp_path / "workers", PYTHONPATH=str(other.parent)):
        done = merge_cosim("sweep", small_scenario(tmp_path), "--method", "acc", "--dask", scheduler, cwd=tmp_path)
    assert done.returncode == 2
    assert re.search(r"worker \S+ has merge-cosim's source [0-9a-f]{16} instead of [0-9a-f]{16}", done.stderr)
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Port 8787 is already in use")  # by the scheduler above
def test_a_local_cluster_gives_the_same_bytes(tmp_path):
    scenarios = small_scenario(tmp_path), small_scene(tmp_path)
    for out, where in (("here", ()), ("there", ("--dask", "local", "--jobs", 1))):
        done = merge_cosim("sweep", *scenarios, "--method", "pgm", *where, "--out", out, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr
    for name in ("results.parquet", "scenes.csv", "notes.csv"):
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes(), name


def test_no_scheduler_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_executor, "CONNECT_S", 0.5)
    line = refused("sweep", small_scenario(tmp_path), "--dask", "tcp://127.0.0.1:9", cwd=tmp_path)
    assert "no scheduler answers there" in line


def test_without_dask_installed_there_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install 'merge-cosim[dask]'" in refused(
        "sweep", small_scenario(tmp_path), "--dask", "local", cwd=tmp_path
    )


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

"""Executors: every one gives the same rows, and a killed worker costs no more than its chunk."""

import multiprocessing.spawn
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from multiprocessing import resource_tracker

import psutil
import pyarrow as pa
import pyarrow.parquet
import pytest
from command import COMMAND

from merge_cosim.core.errors import UserError
from merge_cosim.results.schema import KEY
from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.chunks import ChunkQueue, cut
from merge_cosim.sweeps.executors import InProcess, Processes
from merge_cosim.sweeps.plan import SweepRequest, plan

CASES = {"encounters.count": 120}


def chunks(methods=("acc", "slot"), most=40):
    return list(cut(plan(SweepRequest(["designed-random"], methods, settings=CASES)), most))


def rows(executor, queue=None):
    with closing(executor):
        finished = list(executor.run(queue or ChunkQueue(chunks())))
    assert len({one.chunk.name for one in finished}) == len(finished) == 6
    for one in finished:
        assert len(one.rows) == len(one.chunk)
    return pa.concat_tables([one.rows for one in finished]).sort_by(KEY)


@pytest.fixture(scope="module")
def expected():
    return rows(InProcess())


def kill_workers(count, stop, killed):
    """Kill the first `count` different worker processes of this process that are seen."""
    me = os.getpid()
    while len(killed) < count and not stop.is_set():
        for process in psutil.Process(me).children():
            if process.pid not in killed and "resource_tracker" not in " ".join(process.cmdline()):
                killed.add(process.pid)
                os.kill(process.pid, signal.SIGKILL)
                break
        time.sleep(0.01)


def test_processes_of_a_fork_server_give_the_rows_of_one(expected):
    """Those of `spawn`, the default, give them below."""
    assert rows(Processes(2, start="forkserver")).equals(expected)


def test_forks_give_the_rows_of_one(expected, tmp_path):
    """In a process of its own: here another test may have left a thread, beside which there is no fork."""
    words = ["sweep", "designed-random", "--method", "acc,slot", "--set", "encounters.count=120", "--jobs", "2"]
    subprocess.run([*COMMAND, *words, "--start", "fork", "--out", "out"], cwd=tmp_path, capture_output=True, check=True)
    found = pa.parquet.read_table(tmp_path / "out/results.parquet").sort_by(KEY)
    same = [name for name in expected.column_names if not name.startswith("cycle_us")]
    assert found.select(same).equals(expected.select(same))


def test_workers_wait_for_the_next_queue_and_end_with_the_executor(expected):
    resource_tracker.ensure_running()  # it stays
    before = set(psutil.Process().children())
    with closing(Processes(2)) as executor:
        first = list(executor.run(ChunkQueue(chunks())))
        workers = set(psutil.Process().children()) - before
        again = list(executor.run(ChunkQueue(chunks())))
        assert set(psutil.Process().children()) - before == workers
        assert len(workers) >= 2
    assert not set(psutil.Process().children()) & workers
    for found in (first, again):
        assert len({one.chunk.name for one in found}) == len(found) == 6
        assert pa.concat_tables([one.rows for one in found]).sort_by(KEY).equals(expected)


def test_a_killed_worker_costs_its_piece_only(expected):
    stop, killed = threading.Event(), set()
    killer = threading.Thread(target=kill_workers, args=(2, stop, killed))
    killer.start()
    try:
        found = rows(Processes(2))
    finally:
        stop.set()
        killer.join()
    assert len(killed) == 2
    assert found.equals(expected)


@pytest.mark.parametrize("start", ["spawn", "fork"])
def test_workers_end_with_a_sweep_that_is_killed(tmp_path, start):
    (tmp_path / "stuck.py").write_text(
        """
import os, time
from pathlib import Path
import merge_cosim as mc

@mc.estimator
class Stuck(mc.Estimator):
    def update(self, seen):
        Path(f"{os.getpid()}.pid").touch()
        time.sleep(600)
"""
    )
    words = ("sweep", "designed-random", "--set", "encounters.count=40", "--world", "closed-form")
    words += ("--method", "stuck,stuck+lqr", "--plugin", "stuck.py", "--jobs", "2", "--start", start)
    with subprocess.Popen([*COMMAND, *words], cwd=tmp_path, env=os.environ) as sweep:
        try:
            until = time.monotonic() + 60
            while len(pids := list(tmp_path.glob("*.pid"))) < 2:
                assert (sweep.poll(), time.monotonic() < until) == (None, True)
                time.sleep(0.02)
            workers = [psutil.Process(int(file.stem)) for file in pids]
        finally:
            sweep.kill()
    until = time.monotonic() + 20
    while any(worker.is_running() and worker.status() != psutil.STATUS_ZOMBIE for worker in workers):
        assert time.monotonic() < until
        time.sleep(0.02)


WITHOUT_MEMORY = """
import os, resource, signal, threading
from merge_cosim.sweeps.executors import watch_parent
earlier = threading.Thread(target=int)  # its stack is used again, so that a thread begins and then fails
earlier.start()
earlier.join()
child = os.fork()
if child:
    os._exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) and 1)
resource.setrlimit(resource.RLIMIT_AS, (1 << 20, 1 << 20))
signal.alarm(10)
watch_parent()
os._exit(0)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere the limit holds for other memory")
def test_a_worker_without_memory_for_a_thread_does_not_wait_for_it():
    assert (
        subprocess.run([sys.executable, "-c", WITHOUT_MEMORY], stderr=subprocess.DEVNULL, check=False).returncode == 0
    )


ENDED_AT_ONCE = """
import os, signal
from merge_cosim.cli.interrupts import ended_by_signal
from merge_cosim.core.errors import UserError
from merge_cosim.sweeps.chunks import ChunkQueue, cut
from merge_cosim.sweeps.executors import Processes
from merge_cosim.sweeps.plan import SweepRequest, plan

ended_by_signal()
os.register_at_fork(after_in_child=lambda: os.kill(os.getpid(), signal.SIGTERM))
request = SweepRequest(["designed-random"], ["acc"], settings={"encounters.count": 2}, world="closed-form")
try:
    list(Processes(2, start="fork").run(ChunkQueue(cut(plan(request), 2))))
except UserError as error:
    print(error)
"""


def test_a_worker_that_is_ended_while_it_starts_ends_without_a_traceback():
    done = subprocess.run([sys.executable, "-c", ENDED_AT_ONCE], capture_output=True, text=True, check=False)
    assert "3 worker processes in a row died while running these cases, the last one by signal 15" in done.stdout
    assert done.stderr == ""


def test_an_interpreter_that_cannot_start_is_one_line(tmp_path, monkeypatch, capfd):
    program = tmp_path / "python"
    program.write_text("#!/bin/sh\nprintf 'Traceback (most recent call last):\\n  File\\nMemoryError\\n' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setattr(multiprocessing.spawn, "_python_exe", os.fsencode(program))
    with pytest.raises(UserError, match=r"3 worker processes .*, the last one with status 1: MemoryError \(9: killed"):
        list(Processes(2).run(ChunkQueue(chunks())))
    os.write(2, b"here")
    assert capfd.readouterr().err == "here"  # nothing else, and standard error is what it was


def test_a_worker_prints_on_the_standard_error_of_its_parent(tmp_path, capfd):
    plugin = tmp_path / "loud.py"
    plugin.write_text("import os, multiprocessing\nif multiprocessing.parent_process(): os.write(2, b'of a worker')\n")
    list(Processes(1, [plugin]).run(ChunkQueue(chunks(["always-go"], 120))))
    assert capfd.readouterr().err == "of a worker"


@pytest.mark.slow
def test_a_piece_that_kills_every_worker_ends_the_sweep_with_a_clear_line(tmp_path):
    plugin = tmp_path / "deadly.py"
    plugin.write_text(
        """
import os, signal
from dataclasses import dataclass
from typing import ClassVar
from merge_cosim.estimators.base import Estimator, estimators

@estimators.register
@dataclass(kw_only=True)
class Deadly(Estimator):
    name: ClassVar[str] = "deadly"
    def update(self, seen):
        os.kill(os.getpid(), signal.SIGKILL)
"""
    )
    request = SweepRequest(["designed-random"], ["acc", "deadly"], settings=CASES, plugins=[plugin])
    queue = ChunkQueue(cut(plan(request), 60))
    with pytest.raises(
        UserError, match=r"designed-random, deadly, cases r00000\d0 to .* 3 worker processes .* signal 9"
    ):
        list(Processes(2, [plugin], "forkserver").run(queue))  # which starts workers at little cost


def test_an_error_of_a_plugin_in_a_worker_names_its_line(tmp_path):
    plugin = tmp_path / "faulty.py"
    plugin.write_text(
        """
from dataclasses import dataclass
from typing import ClassVar
from merge_cosim.estimators.base import Estimator, estimators

@estimators.register
@dataclass(kw_only=True)
class Faulty(Estimator):
    name: ClassVar[str] = "faulty"
    def update(self, seen):
        return 1 / 0
"""
    )
    request = SweepRequest(["designed-random"], ["faulty"], settings=CASES, plugins=[plugin])
    with pytest.raises(UserError) as raised:
        list(Processes(1, [plugin], "forkserver").run(ChunkQueue(cut(plan(request), 60))))
    fault = "line 11, in Faulty.update: return 1 / 0: ZeroDivisionError: division by zero"
    assert str(raised.value) == f"{plugin}, {fault}"


def test_no_fork_beside_threads():
    stop = threading.Event()
    thread = threading.Thread(target=stop.wait)
    thread.start()
    try:
        with pytest.raises(UserError, match="--start spawn"):
            Processes(2, start="fork")
    finally:
        stop.set()
        thread.join()


def test_pieces_cover_all_cases_once():
    found = chunks(most=50)
    for batch in {id(chunk.whole): chunk.whole for chunk in found}.values():
        own = [chunk for chunk in found if chunk.whole is batch]
        assert [chunk.first for chunk in own] == [0, 40, 80]
        assert own[-1].last == len(batch)
        assert own[1].task().cases.encounters.case.tolist() == batch.cases.encounters.case[40:80].tolist()


def test_the_longest_piece_goes_first_once_methods_are_known():
    queue = ChunkQueue(chunks(most=30))
    first, second = queue.take(), queue.take()
    assert {first.whole.method.name, second.whole.method.name} == {"acc", "slot"}  # one of each to begin with
    slow, quick = (first, second) if first.whole.method.name == "slot" else (second, first)
    queue.finished(slow, Effort(wall_s=50.0))
    queue.finished(quick, Effort(wall_s=1.0))
    order = [queue.take() for _ in range(len(queue))]
    assert [chunk.whole.method.name for chunk in order] == ["slot"] * 3 + ["acc"] * 3
    lengths = [chunk.cycles for chunk in order[:3]]
    assert lengths == sorted(lengths, reverse=True)
    assert queue.take() is None

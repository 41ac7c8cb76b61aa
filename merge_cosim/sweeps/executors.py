"""Executors: where the chunks of a sweep are run. All of them give the same rows."""

from __future__ import annotations

import _thread
import atexit
import gc
import multiprocessing
import os
import pickle
import signal
import tempfile
import threading
import traceback
from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import load_plugin
from merge_cosim.core.signals import STDERR, interrupts_ignored, starts_silently
from merge_cosim.sweeps.chunks import Chunk, ChunkQueue, Finished
from merge_cosim.sweeps.shipping import dumps, main_hidden, pack, unpack
from merge_cosim.sweeps.worker_session import WorkerSession

if TYPE_CHECKING:  # a worker process plans nothing, and need not import what planning needs
    from merge_cosim.sweeps.plan import StartMethod, SweepRequest

MOST_LOSSES = 3
"""Workers that one chunk may lose before the sweep gives up on it."""


class Executor(Protocol):
    """Runs chunks somewhere."""

    def run(self, queue: ChunkQueue) -> Generator[Finished]:
        """Run all chunks of `queue` and yield each as soon as it is done, in any order; it may be called again.

        Raises:
            UserError: There is no place to run them, or a chunk cannot be run.
        """

    def close(self) -> None:
        """End what still waits for chunks."""


def executor_for(request: SweepRequest, chunks: int) -> Executor:
    """The executor that a request asks for; a single process needs no other."""
    if request.dask is not None:
        from merge_cosim.sweeps.dask_executor import Cluster

        return Cluster(request.dask, request.jobs, request.plugins)
    jobs = min(request.jobs, chunks)
    return Processes(jobs, request.plugins, request.start) if jobs > 1 else InProcess()


class InProcess:
    """Runs the chunks in this process, one after the other."""

    def run(self, queue: ChunkQueue) -> Generator[Finished]:
        """See `Executor`."""
        worker_session = WorkerSession()
        try:
            while chunk := queue.take():
                yield Finished(chunk, *chunk.task().run(worker_session))
        finally:
            worker_session.close()

    def close(self) -> None:
        """See `Executor`; nothing waits."""


class Processes:
    """Runs the chunks in processes of this machine, each with a SUMO of its own; they stay until it is closed.

    Every worker holds one chunk at a time and has its own pipe, so one that is killed takes no other with it: its chunk
    goes to a new worker. (The pool of the standard library breaks as a whole.)

    `spawn` starts every worker as a fresh interpreter, which is safe everywhere. `fork` copies this process, which
    spares a worker its imports; it is refused where threads run, which a copy would not have. (Those of numpy and
    pyarrow are not seen by that.) `forkserver` copies a fresh process that has imported what workers need, no more.
    """

    def __init__(self, jobs: int, plugins: Sequence[Path] = (), start: StartMethod = "spawn") -> None:
        if start not in multiprocessing.get_all_start_methods():
            raise UserError(f"--start {start}: this system cannot; use --start spawn")
        if start == "fork" and threading.active_count() > 1:
            raise UserError("--start fork: this process runs threads, which a fork would break; use --start spawn")
        self._jobs = jobs
        self._plugins = tuple(plugins)
        self._context = multiprocessing.get_context(start)
        if start == "forkserver":
            self._context.set_forkserver_preload([__name__])
        self._workers: dict[Connection, _Worker] = {}

    def run(self, queue: ChunkQueue) -> Generator[Finished]:
        """See `Executor`."""
        losses: Counter[str] = Counter()
        try:
            for worker in self._workers.values():
                worker.begin(queue.take())
            for _ in range(min(self._jobs - len(self._workers), len(queue))):
                self._start(queue.take())
            while busy := [connection for connection, worker in self._workers.items() if worker.chunk]:
                for connection in wait(busy):
                    assert isinstance(connection, Connection)
                    worker = self._workers[connection]
                    chunk = worker.chunk
                    assert chunk is not None
                    try:
                        outcome = pickle.loads(connection.recv_bytes())
                    except (EOFError, OSError):
                        del self._workers[connection]
                        losses[chunk.name] += 1
                        if losses[chunk.name] == MOST_LOSSES:
                            raise UserError(_lost(chunk, worker)) from None
                        worker.stop()
                        self._start(chunk)
                        continue
                    if isinstance(outcome, BaseException):
                        raise outcome
                    worker.begin(queue.take())  # before its rows are stored, so that it need not wait for that
                    yield Finished(chunk, *outcome)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """See `Executor`."""
        while self._workers:
            self._workers.popitem()[1].stop()

    def _start(self, chunk: Chunk | None) -> None:
        worker = _Worker(self._context, self._plugins)
        self._workers[worker.connection] = worker
        worker.begin(chunk)


class _Worker:
    """A worker process, seen from the process that started it."""

    def __init__(self, context: BaseContext, plugins: tuple[Path, ...]) -> None:
        self.connection, there = context.Pipe()
        self.chunk: Chunk | None = None
        forked = context.get_start_method() == "fork"
        inherited = self.connection if forked else None
        with tempfile.TemporaryFile() as said, starts_silently(said) as errors:
            self._said = os.dup(said.fileno())
            self.process: Any = context.Process(  # type: ignore[attr-defined]
                target=_serve, args=(there, inherited, errors, plugins), name="merge-cosim worker", daemon=True
            )
            with interrupts_ignored(signal.SIGTERM), main_hidden():
                self.process.start()
        there.close()

    def end(self) -> str:
        """How the process ended by itself, and the last line that it printed while it started."""
        self.process.join()
        code = self.process.exitcode
        with open(self._said, errors="replace") as said:
            said.seek(0)
            lines = said.read().splitlines()
        why = f": {lines[-1]}" if lines else ""
        return (f"by signal {-code}" if code < 0 else f"with status {code}") + why

    def begin(self, chunk: Chunk | None) -> None:
        self.chunk = chunk
        if chunk is not None:
            packed = pack(chunk.task())
            with suppress(OSError):  # the process has died; reading from it fails next
                self.connection.send_bytes(packed)

    def stop(self) -> None:
        """End the process: at once if it runs a chunk, else by an empty message, on which it ends itself."""
        if self.chunk is not None:
            self.process.terminate()
        else:
            with suppress(OSError):
                self.connection.send_bytes(b"")
        self.connection.close()
        os.close(self._said)
        self.process.join()


def _serve(
    parent: Connection, inherited: Connection | None, errors: Connection | None, plugins: tuple[Path, ...]
) -> None:
    """What a worker process does: run what comes through the pipe, until that is empty or closed."""
    if errors is not None:
        os.dup2(errors.fileno(), STDERR)
        errors.close()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process gets it, too, and ends the workers
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    watch_parent()
    if inherited is not None:
        inherited.close()  # else the worker would not notice the end of its parent process
    atexit.register(gc.freeze)  # at its end nothing is searched for unused objects, which takes as long as a chunk
    worker_session = WorkerSession()
    try:
        for plugin in plugins:
            load_plugin(plugin)
        while packed := parent.recv_bytes():
            outcome: object
            try:
                outcome = unpack(packed).run(worker_session)
            except Exception as error:
                if not isinstance(error, UserError):  # pickle leaves the traceback out
                    error.add_note(f"In a worker process:\n{traceback.format_exc()}")
                outcome = error
            parent.send_bytes(dumps(outcome))  # an error's class may be one of the user's
    except (EOFError, OSError, MemoryError):  # the parent process was killed, or an outcome has no room
        pass
    finally:
        worker_session.close()


def watch_parent() -> None:
    """End this process with its parent, from a thread; without memory for one it goes on to the end of its chunk."""
    with suppress(RuntimeError):
        _thread.start_new_thread(_end_with_parent, ())  # for want of memory `Thread.start` may wait for ever


def _end_with_parent() -> None:
    """End this process when its parent is gone, also amid a chunk; what it has written so far has a scratch name."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGKILL)


def _lost(chunk: Chunk, worker: _Worker) -> str:
    return (
        f"{chunk}: {MOST_LOSSES} worker processes in a row died while running these cases, the last one {worker.end()} "
        f"(9: killed, as for want of memory); what was finished is kept, go on with --resume, perhaps with fewer --jobs"
    )

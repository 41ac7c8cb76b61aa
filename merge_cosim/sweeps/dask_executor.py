"""The executor for a Dask cluster: the same chunks on workers of other machines."""

from __future__ import annotations

import logging
import threading
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from uuid import uuid4

import pyarrow as pa

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import cache_folder, write_atomically
from merge_cosim.core.registry import load_plugin
from merge_cosim.core.signals import interrupts_ignored
from merge_cosim.ramps.ramp import find_ramp
from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.chunks import Chunk, ChunkQueue, Finished
from merge_cosim.sweeps.identity import digest, digest_of, ramp_files, software
from merge_cosim.sweeps.shipping import main_hidden, pack, unpack
from merge_cosim.sweeps.worker_session import WorkerSession

LOCAL = "local"
"""Address that stands for a cluster of this machine's processes, made for the sweep."""
CONNECT_S = 5.0
"""Time [s] in which a scheduler must answer."""
WORKERS_S = 60.0
"""Time [s] in which its first worker must be there."""
ONE_THREAD = "libsumo holds one simulation per process; start the workers with: dask worker ADDRESS --nthreads 1"


@dataclass(frozen=True)
class WorkerFiles:
    """Files that a worker on another machine needs beside the task with its cases, scenario, method and model.

    Attributes:
        software: What this process runs; a worker that runs anything else is refused.
        ramp: Files of the ramp by name.
        ramp_name: Its name.
        plugins: Files with the user's own components by name.
    """

    software: Mapping[str, str]
    ramp: Mapping[str, bytes]
    ramp_name: str
    plugins: Mapping[str, bytes]


class Cluster:
    """Runs the chunks on the workers of a Dask scheduler.

    Chunks of a lost worker are given to others by the scheduler; workers may join and leave during the sweep.
    """

    def __init__(self, address: str, jobs: int = 1, plugins: Sequence[Path] = ()) -> None:
        self._address = address
        self._jobs = jobs
        self._plugins = {plugin.name: plugin.read_bytes() for plugin in plugins}
        try:
            import distributed
        except ImportError:
            raise UserError("--dask: dask.distributed is not installed; pip install 'merge-cosim[dask]'") from None
        self._distributed: Any = distributed
        for name in ("distributed", "distributed.client"):  # we report lost connections, in one line
            logging.getLogger(name).setLevel(logging.CRITICAL)

    def run(self, queue: ChunkQueue) -> Generator[Finished]:
        """See `Executor`."""
        worker_files_of: dict[str, WorkerFiles] = {}
        session = uuid4().hex[:8]
        with self._client() as client:
            self._check(client)
            running: dict[Any, Chunk] = {}
            done = self._distributed.as_completed()

            def fill() -> None:
                """Submit one chunk per worker in advance and no more, so that the longest still go first."""
                while len(running) < 2 * max(1, len(client.nthreads())) and (chunk := queue.take()):
                    ramp = chunk.whole.scenario.ramp
                    if ramp not in worker_files_of:
                        name = find_ramp(ramp).resolve().name
                        worker_files_of[ramp] = WorkerFiles(software(), ramp_files(ramp), name, self._plugins)
                    key = f"merge-cosim-{session}-{chunk.name}"
                    future = client.submit(run_shipped, pack(chunk.task()), worker_files_of[ramp], key=key, pure=False)
                    running[future] = chunk
                    done.add(future)

            fill()
            for future in done:
                chunk = running.pop(future)
                rows, effort = self._result(future, chunk)
                fill()
                yield Finished(chunk, rows, effort)

    def close(self) -> None:
        """See `Executor`; the client is closed after each run."""

    @contextmanager
    def _client(self) -> Iterator[Any]:
        if self._address == LOCAL:
            with interrupts_ignored(), main_hidden():
                cluster = self._distributed.LocalCluster(
                    n_workers=self._jobs,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            with cluster, self._distributed.Client(cluster) as client:
                yield client
            return
        try:
            client = self._distributed.Client(self._address, timeout=CONNECT_S)
        except (OSError, TimeoutError, ValueError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise UserError(f"--dask {self._address}: no scheduler answers there ({reason})") from None
        with client:
            yield client

    def _check(self, client: Any) -> None:
        """Refuse workers that cannot give the same rows."""
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise UserError(f"--dask {self._address}: no worker within {WORKERS_S:g} s; start some") from None
        for worker, threads in client.nthreads().items():
            if threads != 1:
                raise UserError(f"--dask {self._address}: worker {worker} has {threads} threads; {ONE_THREAD}")
        for worker, theirs in client.run(software, on_error="return").items():
            if isinstance(theirs, BaseException):
                raise UserError(f"--dask {self._address}: worker {worker} cannot run merge-cosim: {theirs!r}")
            _compare(theirs, software(), f"worker {worker}")

    def _result(self, future: Any, chunk: Chunk) -> tuple[pa.Table, Effort]:
        try:
            rows, effort = future.result()
        except self._distributed.scheduler.KilledWorker as error:
            raise UserError(f"{chunk}: several workers died while running these cases ({error})") from None
        except self._distributed.client.FutureCancelledError:
            raise UserError(
                f"--dask {self._address}: the scheduler was lost; what was finished is kept, go on with --resume"
            ) from None
        return rows, effort


def _compare(theirs: Mapping[str, str], ours: Mapping[str, str], who: str) -> None:
    wrong = [f"{name} {theirs.get(name)} instead of {ours[name]}" for name in ours if theirs.get(name) != ours[name]]
    if wrong:
        raise UserError(f"--dask: {who} has {', '.join(wrong)}; rows would not be the same, install the same there")


_at_work = threading.Lock()
_workplace: WorkerSession | None = None
_plugins_here: dict[str, str] = {}


def run_shipped(packed: bytes, worker_files: WorkerFiles) -> tuple[pa.Table, Effort]:
    """What a Dask worker does with a chunk: check, unpack, run; its SUMO stays open for the next one.

    Raises:
        UserError: The worker runs several tasks at a time, or other versions.
    """
    global _workplace
    if not _at_work.acquire(blocking=False):
        raise UserError(f"--dask: a worker runs several tasks at a time; {ONE_THREAD}")
    try:
        _compare(software(), worker_files.software, "a worker")
        for name, content in worker_files.plugins.items():
            _load_shipped(name, content)
        ramp = _unpack("ramps", worker_files.ramp, worker_files.ramp_name)
        if _workplace is None:
            _workplace = WorkerSession()
        task = unpack(packed)
        here = replace(task, scenario=task.scenario.model_copy(update={"ramp": str(ramp)}))
        return here.run(_workplace)
    finally:
        _at_work.release()


def _load_shipped(name: str, content: bytes) -> None:
    held = digest(content)
    if name not in _plugins_here:
        load_plugin(_unpack("plugins", {name: content}, "") / name)
        _plugins_here[name] = held
    elif _plugins_here[name] != held:
        raise UserError(f"--dask: the workers have loaded another {name} before; restart them")


def _unpack(kind: str, files: Mapping[str, bytes], name: str) -> Path:
    """Write a worker's files into a folder of the cache whose name is a hash of them."""
    folder = cache_folder("shipped", kind, digest_of(files), name)
    for key, content in files.items():
        if not (folder / key).is_file() or (folder / key).read_bytes() != content:
            write_atomically(folder / key, content)
    return folder

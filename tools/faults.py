"""Faults during sweeps: `python tools/faults.py --faults N --seed S` prints what became of them.

A short sweep in the closed form, in two worker processes, is struck at a random moment; `--resume` goes on and is
struck again, up to four times, and then ends undisturbed. Afterwards the folder must hold the bytes of a sweep that
nothing has struck; after each fault whatever bears its final name must be whole, and no process left behind. A fault
counts if the sweep was still at work.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count, cycle, islice
from pathlib import Path
from typing import NoReturn

import pandas as pd
import psutil
import pyarrow.parquet as pq

import merge_cosim.api.sweep
from merge_cosim.cli.main import main as merge_cosim_main

assert merge_cosim.api.sweep  # every copy of this process has it
METHODS = ("acc", "slot", "always-go")
SWEEP = ("sweep", "designed-random", "--world", "closed-form", "--set", "encounters.count=40", "--jobs", "2")
SWEEP += ("--set", "test.horizon=8", *(word for name in METHODS for word in ("--method", name)))
LIMIT = 120.0
"""Longest time for a sweep [s]."""
NOBODY = 65_534
"""An ordinary user."""
STRIKES = 4
"""Faults that one sweep bears."""
DISK = 64 << 20
"""Room on the small disk on which the sweeps lie [bytes]."""


@dataclass
class Struck:
    """A sweep that is struck.

    Attributes:
        folder: Its working folder; the result folder is `out` in it.
        rng: Random numbers of this fault.
        usual: How long a sweep takes that nothing strikes [s].
        before: Called in the sweep's own process before it begins.
        environment: Environment variables of the sweep that goes on.
        sessions: The sessions of its processes.
        damaged: Files that were damaged, and so need not be whole.
    """

    folder: Path
    rng: random.Random
    usual: float
    before: Callable[[], object] = field(default=lambda: None)
    environment: dict[str, str] = field(default_factory=dict)
    sessions: set[int] = field(default_factory=set)
    damaged: set[Path] = field(default_factory=set)

    @property
    def out(self) -> Path:
        """The result folder."""
        return self.folder / "out"

    def begin(self) -> int:
        """Begin the sweep in a process of its own, at the head of a group; returns its id."""
        hidden = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        child = os.fork()
        if not child:
            self._run(hidden)
        signal.pthread_sigmask(signal.SIG_SETMASK, hidden)
        self.sessions.add(child)
        return child

    def _run(self, mask: set[signal.Signals]) -> NoReturn:
        """What the process does, whatever signal comes."""
        status = 1
        try:
            os.setsid()
            os.environ.update(self.environment)
            with (self.folder / "said.txt").open("a") as said:
                for descriptor in (1, 2):
                    os.dup2(said.fileno(), descriptor)
            sys.stdout, sys.stderr = (os.fdopen(descriptor, "w") for descriptor in (1, 2))
            sys.argv = ["merge-cosim", *SWEEP, "--start", "fork", "--out", str(self.out), "--resume"]
            self.before()
            signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            merge_cosim_main()
        except SystemExit as end:
            status = int(end.code or 0)
        except KeyboardInterrupt:  # before the command heard it
            status = 130
        except BaseException:
            sys.excepthook(*sys.exc_info())
        finally:
            with suppress(BaseException):
                sys.stderr.flush()
            os._exit(status)

    def wait(self, child: int, limit: float = LIMIT) -> int | None:
        """Status of a process (negative: the signal); None if it goes on after so long."""
        until = time.monotonic() + limit
        while time.monotonic() < until:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.002)
        return None

    def moment(self) -> None:
        """Wait for a random moment within a sweep."""
        time.sleep(self.rng.uniform(0.0, self.usual))


def kill(sweep: Struck) -> bool:
    """With kill -9."""
    return _signal(sweep, signal.SIGKILL)


def terminate(sweep: Struck) -> bool:
    """With SIGTERM."""
    return _signal(sweep, signal.SIGTERM)


def interrupt_twice(sweep: Struck) -> bool:
    """With Ctrl-C twice: both go to all processes of the terminal."""
    child = sweep.begin()
    sweep.moment()
    with suppress(ProcessLookupError):
        for _ in range(2):
            os.killpg(child, signal.SIGINT)
            time.sleep(sweep.rng.uniform(0.0, 0.1))
    return _end(sweep, child) != 0


def lose_worker(sweep: Struck) -> bool:
    """By kill -9 of a worker: the sweep goes on by itself."""
    child, struck = sweep.begin(), False
    while not struck and psutil.Process(child).status() != psutil.STATUS_ZOMBIE:
        with suppress(psutil.Error):
            if workers := psutil.Process(child).children():
                time.sleep(sweep.rng.uniform(0.0, 0.1))
                sweep.rng.choice(workers).kill()
                struck = True
        time.sleep(0.002)
    status = _end(sweep, child)
    assert status == 0, f"status {status} for want of a worker"
    return struck


def fill_disk(sweep: Struck) -> bool:
    """By a disk that is full, on which room is made afterwards."""
    filler = sweep.folder / "filler"
    free = os.statvfs(sweep.folder).f_bavail * os.statvfs(sweep.folder).f_bsize
    with filler.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(4096, free - sweep.rng.randint(1, 25) * 4096))
    status = _end(sweep, sweep.begin())
    filler.unlink()
    return status != 0


def limit_files(sweep: Struck) -> bool:
    """By a limit of the size of files."""
    most = sweep.rng.randint(1, 30) * 1024

    def before() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    sweep.before = before
    return _end(sweep, sweep.begin()) != 0


def limit_memory(sweep: Struck) -> bool:
    """By a limit of memory, which from some moment on leaves its processes, or one of them, what they have mapped."""
    child = sweep.begin()
    time.sleep(sweep.rng.uniform(0.0, sweep.usual / 4.0))  # later on little more is needed
    with suppress(psutil.Error):
        processes = [psutil.Process(child), *psutil.Process(child).children(recursive=True)]
        for process in processes if sweep.rng.random() < 0.5 else [sweep.rng.choice(processes)]:
            most = process.memory_info().rss  # it has mapped more; a fresh interpreter has room to begin
            process.rlimit(psutil.RLIMIT_AS, (most, most))
    return _end(sweep, child) != 0


def forbid_writing(sweep: Struck) -> bool:
    """By a folder that an ordinary user may only read."""
    sweep.out.mkdir(exist_ok=True)
    places = [sweep.out, *(one for one in sweep.out.rglob("*") if one.is_dir())]
    for place in places:
        place.chmod(0o555)
    sweep.before = (lambda: os.setuid(NOBODY)) if os.getuid() == 0 else lambda: None
    status = _end(sweep, sweep.begin())
    for place in places:
        place.chmod(0o755)
    assert status in (0, 2), f"status {status} in a folder that is read-only"
    return status == 2


def damage(sweep: Struck) -> bool:
    """With kill -9, and then other bytes in stored parts or in the cache."""
    struck = kill(sweep)
    cache = Path(os.environ["MERGE_COSIM_CACHE"])
    files = [file for place in (sweep.out / "parts", cache) for file in place.rglob("*") if file.is_file()]
    files = [file for file in files if file.stat().st_size and file.suffix not in (".lock", ".json")]
    for file in sweep.rng.sample(files, min(2, len(files))) if struck else ():
        sweep.damaged.add(file)
        content = bytearray(file.read_bytes())
        for _ in range(8):
            content[sweep.rng.randrange(len(content))] ^= sweep.rng.randrange(1, 256)
        file.write_bytes(content[: sweep.rng.choice((len(content), sweep.rng.randrange(len(content))))])
    return struck and bool(files)


def change_clock(sweep: Struck) -> bool:
    """With kill -9, and then another time zone and language, and files of another year."""
    struck = kill(sweep)
    then = sweep.rng.choice((1.0, 4e9))
    for file in sweep.folder.rglob("*"):
        os.utime(file, (then, then))
    zone = sweep.rng.choice(("Pacific/Kiritimati", "America/Los_Angeles", "Asia/Kathmandu"))
    language = sweep.rng.choice(("C", "POSIX", "de_DE.UTF-8", "tr_TR.UTF-8"))
    sweep.environment = {"TZ": zone, "LC_ALL": language, "LANG": language}
    return struck


FAULTS: dict[Callable[[Struck], bool], int] = {
    kill: 5,
    terminate: 5,
    interrupt_twice: 5,
    lose_worker: 5,
    fill_disk: 2,
    limit_files: 2,
    limit_memory: 2,
    forbid_writing: 2,
    damage: 5,
    change_clock: 3,
}
"""Kinds of faults, and how many of each come in a turn."""


def _signal(sweep: Struck, number: int) -> bool:
    child = sweep.begin()
    sweep.moment()
    with suppress(ProcessLookupError):
        os.kill(child, number)
    return _end(sweep, child) != 0


def _end(sweep: Struck, child: int) -> int:
    """Status of a sweep that was struck, which must end by itself."""
    status = sweep.wait(child)
    if status is None:
        os.killpg(child, signal.SIGKILL)
        sweep.wait(child)
        raise AssertionError("it hangs")
    return status


@contextmanager
def small_disk() -> Iterator[Path]:
    """A folder on a small disk of its own (where this user may mount one), which can be filled."""
    with tempfile.TemporaryDirectory() as scratch:
        mounted = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "none", scratch], capture_output=True, check=False
        )
        Path(scratch).chmod(0o755)
        try:
            yield Path(scratch)
        finally:
            if mounted.returncode == 0:
                subprocess.run(["umount", "--lazy", scratch], check=True)


def resume(sweep: Struck) -> None:
    """Go on without a fault."""
    sweep.before = lambda: None
    status = _end(sweep, sweep.begin())
    assert status == 0, f"--resume ends with status {status}"


def whole(sweep: Struck) -> None:
    """Whatever bears its final name can be read to its end."""
    for file in set(sweep.out.rglob("*")) - sweep.damaged:
        if file.suffix == ".parquet":
            pq.read_table(file, page_checksum_verification=True)
        elif file.suffix == ".json":
            json.loads(file.read_text())


def left_behind(sweep: Struck) -> list[int]:
    """Processes of a sweep that are still there a moment later."""
    until = time.monotonic() + 10.0
    while True:
        found = []
        for number in psutil.pids():
            with suppress(ProcessLookupError, psutil.Error):
                if os.getsid(number) in sweep.sessions and psutil.Process(number).status() != psutil.STATUS_ZOMBIE:
                    found.append(number)
        if not found or time.monotonic() > until:
            return found
        time.sleep(0.02)


def held(out: Path) -> dict[str, object]:
    """What must be the same: bytes, and all columns of the summary but the times of a cycle."""
    summary = pd.read_csv(out / "summary.csv")
    times = [name for name in summary if name.startswith("cycle_us")]
    bytes_of = {name: (out / name).read_bytes() for name in ("results.parquet", "traces.parquet", "strata.csv")}
    return {**bytes_of, "summary": summary.drop(columns=times).to_csv()}


def strike(kind: Callable[[Struck], bool], sweep: Struck) -> bool:
    """One fault, and a look at what it leaves; whether the sweep was still at work."""
    sweep.before = lambda: None
    struck = kind(sweep)
    whole(sweep)
    orphans = left_behind(sweep)
    assert not orphans, f"left behind: {orphans}"
    return struck


def finish(sweep: Struck, expected: dict[str, object]) -> None:
    """Go on to the end and compare."""
    resume(sweep)
    differing = [name for name, value in held(sweep.out).items() if value != expected[name]]
    assert not differing, f"differs: {', '.join(differing)}"
    said = (sweep.folder / "said.txt").read_text(errors="replace")
    begin = said.find("Traceback (most recent call last)")
    assert begin < 0, f"a traceback: {said[begin : begin + 3000]}"


def undisturbed(place: Path) -> tuple[float, dict[str, object]]:
    """How long the sweep takes [s], and what it gives; this process has loaded all that it needs afterwards."""
    words = ["merge-cosim", *SWEEP[: SWEEP.index("--jobs")], *SWEEP[SWEEP.index("--jobs") + 2 :], "--jobs", "1"]
    (place / "loaded").mkdir()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        sys.argv = [*words, "--out", str(place / "loaded" / "out")]
        with suppress(SystemExit):
            merge_cosim_main()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # the command has set it
    (place / "undisturbed").mkdir()
    sweep, began = Struck(place / "undisturbed", random.Random(), 0.0), time.monotonic()
    resume(sweep)
    return time.monotonic() - began, held(sweep.out)


def faults(
    number: int, seed: int, minutes: float, kinds: dict[Callable[[Struck], bool], int]
) -> Counter[tuple[str, str]]:
    """Make so many faults, or what some minutes allow, the kinds in turn; returns how many of each ended how."""
    counts: Counter[tuple[str, str]] = Counter()
    turns = cycle([kind for kind, share in kinds.items() for _ in range(share)])
    turns = cycle(random.Random(0).sample(list(islice(turns, sum(kinds.values()))), sum(kinds.values())))
    with small_disk() as place:
        os.environ["MERGE_COSIM_CACHE"] = str(place / "cache")
        usual, expected = undisturbed(place)
        until = time.monotonic() + 60.0 * minutes
        for at in count():
            if counts.total() >= number or time.monotonic() > until:
                return counts
            folder = place / str(at)
            folder.mkdir()
            sweep, struck = Struck(folder, random.Random(f"{seed} {at}"), usual), list[str]()
            try:
                for kind in islice(turns, min(STRIKES, number - counts.total())):
                    if strike(kind, sweep):
                        struck.append(kind.__name__)
                finish(sweep, expected)
                end = "same"
            except (AssertionError, OSError, ValueError) as error:
                struck.append(kind.__name__)
                end = "wrong"
                print(f"sweep {at}, {', '.join(struck)}: {error}", file=sys.stderr, flush=True)
            counts.update((name, end) for name in struck)
            shutil.rmtree(folder, ignore_errors=True)
    return counts


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faults", type=int, default=36)
    parser.add_argument("--minutes", type=float, default=600.0, help="begin no sweep after so long")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="kinds, with commas between")
    given = parser.parse_args()
    kinds = {kind: share for kind, share in FAULTS.items() if not given.only or kind.__name__ in given.only.split(",")}
    began = time.monotonic()
    counts = faults(given.faults, given.seed, given.minutes, kinds)
    by_kind = {one.__name__: {end: counts[one.__name__, end] for end in ("same", "wrong")} for one in kinds}
    total = {end: sum(one[end] for one in by_kind.values()) for end in ("same", "wrong")}
    summary = {"faults": counts.total(), "seed": given.seed, "wall_s": round(time.monotonic() - began), **total}
    print(json.dumps({**summary, "kinds": by_kind}, indent=1))
    return 1 if total["wrong"] else 0


if __name__ == "__main__":
    sys.exit(main())

"""Damaged inputs by the thousand: `python tools/fuzz.py --inputs N --seed S` prints what became of them.

Each input is a good one with a few random changes. What reads it - a reader of the package, or the whole command - runs
in a worker process with limits of time and memory, behind the boundary at which the command turns errors into lines.
Allowed are a right result, as a second reading by independent code finds it (`fuzz_oracles.py`), and one line that
names the file. The rest is kept in `--keep DIR`, to be looked at.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fuzz_oracles import Wrong
from fuzz_targets import TARGETS, Refused, Target

from merge_cosim.cli.main import refusal
from merge_cosim.controllers.base import controllers
from merge_cosim.estimators.base import estimators

LIMIT = 60.0
"""Longest time for one input [s]."""

MEMORY = 8 << 30
"""Most memory of a worker [bytes]."""

TURN = 2_000
"""Inputs that one worker takes; then a fresh one goes on."""

GOOD = ("right", "refused")


@dataclass(frozen=True)
class Outcome:
    """What became of one input.

    Attributes:
        target: Name of the target.
        number: Number of the input.
        kind: `right`, `refused`, or a fault: `wrong`, `traceback`, `line` (which does not name the file),
            `process` (left behind), `hang`, `crash`.
        said: The line, or the traceback.
    """

    target: str
    number: int
    kind: str
    said: str


def outcome(target: Target, number: int, seed: int, folder: Path) -> Outcome:
    """Make one input in a folder and read it, in this process."""
    folder.mkdir()
    rng = random.Random(f"{seed} {target.name} {number}")
    kind, said, check = "right", "", None
    kept = [(registry, dict(registry._classes)) for registry in (estimators, controllers) if registry.names()]
    try:
        with contextlib.chdir(folder):
            check = target.make(folder, rng)()
    except Exception as error:
        line = str(error) if isinstance(error, Refused) else refusal(error)
        if line is None:
            kind, said = "traceback", "".join(traceback.format_exception(error))
        else:
            kind = "refused" if re.search(target.names, line) else "line"
            said = line
    try:
        if check:
            with contextlib.chdir(folder):
                check()
    except Exception as error:  # a second reading that fails where the first did not tells a difference, too
        kind, said = "wrong", str(error) if isinstance(error, Wrong) else traceback.format_exc()
    for registry, classes in kept:  # what a plugin has registered is forgotten
        registry._classes.clear()
        registry._classes.update(classes)
    for name in [name for name in sys.modules if name.startswith("merge_cosim_plugin_")]:
        del sys.modules[name]
    if _left_behind():
        kind = "process"
    return Outcome(target.name, number, kind, said)


def _left_behind() -> bool:
    """Whether this process has a child."""
    try:
        os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        return False
    return True


def outcomes(targets: list[Target], numbers: range, seed: int, scratch: Path, limit: float) -> Iterator[Outcome]:
    """Run inputs in worker processes; one that takes too long or dies is replaced."""
    at = numbers.start
    while at < numbers.stop:
        turn = range(at, min(at + TURN, numbers.stop))
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            os.close(reading)
            _work(targets, turn, seed, scratch, writing)
        os.close(writing)
        for line in _lines(reading, limit):
            at += 1
            if line:
                yield Outcome(**json.loads(line))
            else:
                target = targets[(at - 1) % len(targets)]
                yield Outcome(target.name, at - 1, "crash" if line is not None else "hang", "")
            if at == turn.stop or not line:
                break
        os.close(reading)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _lines(reading: int, limit: float) -> Iterator[bytes | None]:
    """Lines from a pipe: an empty one where it has ended, None where nothing came in time."""
    held = b""
    while True:
        while b"\n" not in held:
            if not select.select([reading], [], [], limit)[0]:
                yield None
            more = os.read(reading, 1 << 16)
            if not more:
                yield b""
            held += more
        line, _, held = held.partition(b"\n")
        yield line


def _work(targets: list[Target], numbers: range, seed: int, scratch: Path, pipe: int) -> None:
    """What a worker does; never returns."""
    os.setsid()
    try:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        nothing = os.open(os.devnull, os.O_WRONLY)
        for descriptor in (1, 2):
            os.dup2(nothing, descriptor)
        sys.stdout, sys.stderr = (os.fdopen(descriptor, "w") for descriptor in (1, 2))
        for number in numbers:
            found = outcome(targets[number % len(targets)], number, seed, scratch / str(number))
            if found.kind in GOOD:
                shutil.rmtree(scratch / str(number), ignore_errors=True)
            os.write(pipe, json.dumps(vars(found)).encode() + b"\n")
    finally:
        os._exit(0)


def fuzz(
    targets: list[Target], inputs: int, seed: int, keep: Path | None = None, limit: float = LIMIT, first: int = 0
) -> Counter[tuple[str, str]]:
    """Run so many inputs from the first one on, the targets in turn; returns how many of each target became what."""
    counts: Counter[tuple[str, str]] = Counter()
    turns = [target for target in targets for _ in range(target.share)]
    random.Random(0).shuffle(turns)
    place = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=place if place.is_dir() else None) as scratch:
        os.environ["MERGE_COSIM_CACHE"] = str(Path(scratch) / "cache")
        for found in outcomes(turns, range(first, first + inputs), seed, Path(scratch), limit):
            counts[found.target, found.kind] += 1
            if found.kind in GOOD:
                continue
            print(f"{found.kind}: {found.target}, input {found.number}: {found.said[-2000:]}", file=sys.stderr)
            if keep is not None:
                shutil.move(Path(scratch) / str(found.number), keep / f"{found.target}-{seed}-{found.number}")
    return counts


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="names of targets, with commas between")
    parser.add_argument("--keep", type=Path, help="folder for the inputs that make a fault")
    given = parser.parse_args()
    if given.keep:
        given.keep.mkdir(parents=True, exist_ok=True)
    targets = [one for one in TARGETS if not given.only or one.name in given.only.split(",")]
    began = time.monotonic()
    counts = fuzz(targets, given.inputs, given.seed, given.keep, first=given.first)
    kinds: Counter[str] = Counter()
    for (_, kind), count in counts.items():
        kinds[kind] += count
    by_target = {one.name: {kind: counts[one.name, kind] for kind in sorted(kinds)} for one in targets}
    used = sum(os.times()[:4])
    summary = {
        "inputs": given.inputs,
        "first": given.first,
        "seed": given.seed,
        "wall_s": round(time.monotonic() - began),
    }
    print(json.dumps({**summary, "cpu_s": round(used), **kinds, "targets": by_target}, indent=1))
    return 0 if set(kinds) <= set(GOOD) else 1


if __name__ == "__main__":
    sys.exit(main())

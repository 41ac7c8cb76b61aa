"""Damaged inputs by the thousand: `python tools/fuzz.py --inputs N --seed S` prints what became of them.

Each input is a good one with a few random changes; the real command takes it in a process of its own, with a time
limit. Allowed are a right result (status 0) and one line (status 2). The rest is kept in `--keep DIR`, to be looked at.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from fuzz_inputs import TARGETS, Target

LIMIT = 60.0
"""Longest time for one input [s]."""

MEMORY = 8 << 30
"""Most memory for one input [bytes]."""


@dataclass(frozen=True)
class Outcome:
    """What became of one input.

    Attributes:
        kind: `right`, `refused`, or a fault: `traceback`, `hang`, `crash`, `lines`.
        words: The command.
        said: What it wrote to standard error.
    """

    kind: str
    words: tuple[str, ...]
    said: str


def run(words: tuple[str, ...], folder: Path, limit: float = LIMIT) -> Outcome:
    """Run the command in a copy of this process, in a folder."""
    said = folder / "stderr.txt"
    child = os.fork()
    if not child:
        _child(words, folder, said)
    until = time.monotonic() + limit
    done, status = os.waitpid(child, os.WNOHANG)
    while not done and time.monotonic() < until:
        time.sleep(0.005)
        done, status = os.waitpid(child, os.WNOHANG)
    if not done:
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return Outcome("hang", words, said.read_text(errors="replace"))
    text = said.read_text(errors="replace")
    return Outcome(_kind(os.waitstatus_to_exitcode(status), text), words, text)


def _child(words: tuple[str, ...], folder: Path, said: Path) -> None:
    """Never returns."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    os.chdir(folder)
    for name, descriptor in (("stdout.txt", 1), (said.name, 2)):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
    sys.stdout, sys.stderr = (os.fdopen(descriptor, "w") for descriptor in (1, 2))
    sys.argv = ["merge-cosim", *words]
    status = 1
    try:
        from merge_cosim.cli.main import main

        main()
    except SystemExit as end:
        status = int(end.code or 0)
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _kind(status: int, said: str) -> str:
    if status < 0:
        return "crash"
    if "Traceback (most recent call last)" in said or status not in (0, 2):
        return "traceback"
    if status == 2:
        lines = [line for line in said.splitlines() if line.startswith("merge-cosim: ")]
        return "refused" if len(lines) == 1 else "lines"
    return "right"


def fuzz(targets: list[Target], inputs: int, seed: int, keep: Path | None = None) -> Counter[tuple[str, str]]:
    """Run so many inputs, the targets in turn; returns how many of each target became what."""
    counts: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["MERGE_COSIM_CACHE"] = str(Path(scratch) / "cache")
        for number in range(inputs):
            target = targets[number % len(targets)]
            folder = Path(scratch) / f"{number}"
            folder.mkdir()
            rng = random.Random(f"{seed} {target.name} {number}")
            words = target.make(folder, rng)
            found = run(words, folder)
            counts[target.name, found.kind] += 1
            if found.kind not in ("right", "refused"):
                print(f"{found.kind}: {target.name}, input {number}: {' '.join(words)[:200]}", file=sys.stderr)
                print(found.said[-2000:], file=sys.stderr)
                if keep is not None:
                    folder.rename(keep / f"{target.name}-{seed}-{number}")
                    continue
            shutil.rmtree(folder, ignore_errors=True)
    return counts


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="names of targets, with commas between")
    parser.add_argument("--keep", type=Path, help="folder for the inputs that make a fault")
    given = parser.parse_args()
    if given.keep:
        given.keep.mkdir(parents=True, exist_ok=True)
    targets = [one for one in TARGETS if not given.only or one.name in given.only.split(",")]
    import merge_cosim.api.sweep  # so that every copy of this process has it

    assert merge_cosim.api.sweep
    began = time.monotonic()
    counts = fuzz(targets, given.inputs, given.seed, given.keep)
    kinds: Counter[str] = Counter()
    for (_, kind), count in counts.items():
        kinds[kind] += count
    by_target = {one.name: {kind: counts[one.name, kind] for kind in sorted(kinds)} for one in targets}
    summary = {"inputs": given.inputs, "seed": given.seed, "seconds": round(time.monotonic() - began), **kinds}
    print(json.dumps({**summary, "targets": by_target}, indent=1))
    return 0 if set(kinds) <= {"right", "refused"} else 1


if __name__ == "__main__":
    sys.exit(main())

"""Tasks cut into chunks, and the order in which the chunks are handed out."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from merge_cosim.simulation.loop import Effort
from merge_cosim.sweeps.task import Task


@dataclass(frozen=True)
class Chunk:
    """Consecutive cases of a task, which one process runs and whose rows are stored together.

    Attributes:
        name: Number of the task and of the chunk in it; the same in every run of the sweep.
        whole: The task.
        first, last: The cases `first` to `last - 1`.
        cycles: Expected cycles of all its cases.
    """

    name: str
    whole: Task
    first: int
    last: int
    cycles: float

    def __len__(self) -> int:
        return self.last - self.first

    def task(self) -> Task:
        """These cases as a task of their own."""
        return self.whole.part(self.first, self.last)

    def __str__(self) -> str:
        first, last = self.whole.case(self.first), self.whole.case(self.last - 1)
        return f"{self.whole.scenario.name}, {self.whole.method.name}, cases {first} to {last}"


def cut(tasks: Sequence[Task], most: int | None = None) -> Iterator[Chunk]:
    """Cut tasks into chunks of nearly equal size and at most `most` cases; None takes each task's own limit."""
    for number, task in enumerate(tasks):
        ends = np.linspace(0, len(task), -(-len(task) // (most or task.most)) + 1).astype(np.int64)
        for chunk, (first, last) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
            yield Chunk(f"{number:04d}-{chunk:05d}", task, first, last, float(task.part(first, last).cycles().sum()))


class Finished(NamedTuple):
    """A chunk that has been run."""

    chunk: Chunk
    rows: pa.Table
    effort: Effort


class ChunkQueue:
    """The chunks that are still to be run, the longest first, so that all processes end at about the same time.

    How long a cycle takes differs by a factor of hundreds between methods and is known only after a chunk of the method
    has been run. So the first chunk of every method goes first, then the chunk that will take longest; a method whose
    first chunk is still running is taken to be slow.
    """

    def __init__(self, chunks: Iterable[Chunk]) -> None:
        self._waiting: dict[str, list[Chunk]] = defaultdict(list)
        for chunk in chunks:
            self._waiting[chunk.whole.method.name].append(chunk)
        for waiting in self._waiting.values():
            waiting.sort(key=lambda chunk: chunk.cycles)
        self._begun: set[str] = set()
        self._seconds: dict[str, float] = defaultdict(float)
        self._cycles: dict[str, float] = defaultdict(float)

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    @property
    def cases(self) -> int:
        """Cases of the chunks that are still to be run."""
        return sum(len(chunk) for waiting in self._waiting.values() for chunk in waiting)

    def take(self) -> Chunk | None:
        """The next chunk, or None if all have been handed out."""
        methods = [method for method, waiting in self._waiting.items() if waiting]
        if not methods:
            return None
        longest = max(methods, key=self._urgency)
        self._begun.add(longest)
        return self._waiting[longest].pop()

    def finished(self, chunk: Chunk, effort: Effort) -> None:
        """Note how long a chunk took, from which the time of its method's other chunks is estimated."""
        self._seconds[chunk.whole.method.name] += effort.wall_s
        self._cycles[chunk.whole.method.name] += chunk.cycles

    def _urgency(self, method: str) -> tuple[bool, float]:
        known = self._cycles[method] > 0
        per_cycle = self._seconds[method] / self._cycles[method] if known else np.inf
        return method not in self._begun, per_cycle * self._waiting[method][-1].cycles

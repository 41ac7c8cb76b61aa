"""Tasks cut into pieces, and the order in which the pieces are handed out."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from merge_cosim.cosim.loop import Effort
from merge_cosim.experiments.work import Task


@dataclass(frozen=True)
class Piece:
    """A stretch of a batch's cases: what is handed to a process, and stored, as a whole.

    Attributes:
        name: Number of the task and of the piece in it; the same in every run of the sweep.
        whole: The whole of it.
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
        """The stretch as a task of its own."""
        return self.whole.part(self.first, self.last)

    def __str__(self) -> str:
        first, last = self.whole.case(self.first), self.whole.case(self.last - 1)
        return f"{self.whole.scenario.name}, {self.whole.method.name}, cases {first} to {last}"


def cut(tasks: Sequence[Task], most: int | None = None) -> Iterator[Piece]:
    """Cut tasks into pieces of at most `most` cases (None: each task's own), as even as can be."""
    for number, task in enumerate(tasks):
        cycles = np.concatenate([[0.0], np.cumsum(task.cycles())])
        ends = np.linspace(0, len(task), -(-len(task) // (most or task.most)) + 1).astype(np.int64)
        for piece, (first, last) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
            yield Piece(f"{number:04d}-{piece:05d}", task, first, last, float(cycles[last] - cycles[first]))


class Handout:
    """The pieces that are still to be run, the longest first, so that all processes end at about the same time.

    How long a cycle takes differs by a factor of hundreds between methods and is known only after a piece of the method
    has been run. So the first piece of every method goes first, then the piece that will take longest; a method whose
    first piece is still running is taken to be slow.
    """

    def __init__(self, pieces: Iterable[Piece]) -> None:
        self._waiting: dict[str, list[Piece]] = defaultdict(list)
        for piece in pieces:
            self._waiting[piece.whole.method.name].append(piece)
        for waiting in self._waiting.values():
            waiting.sort(key=lambda piece: piece.cycles)
        self._begun: set[str] = set()
        self._seconds: dict[str, float] = defaultdict(float)
        self._cycles: dict[str, float] = defaultdict(float)

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def take(self) -> Piece | None:
        """The next piece, or None if all have been handed out."""
        methods = [method for method, waiting in self._waiting.items() if waiting]
        if not methods:
            return None
        longest = max(methods, key=self._urgency)
        self._begun.add(longest)
        return self._waiting[longest].pop()

    def finished(self, piece: Piece, effort: Effort) -> None:
        """Learn from a piece how long its method takes."""
        self._seconds[piece.whole.method.name] += effort.wall_s
        self._cycles[piece.whole.method.name] += piece.cycles

    def _urgency(self, method: str) -> tuple[bool, float]:
        known = self._cycles[method] > 0
        per_cycle = self._seconds[method] / self._cycles[method] if known else np.inf
        return method not in self._begun, per_cycle * self._waiting[method][-1].cycles

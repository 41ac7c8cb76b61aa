"""Batches cut into pieces, and the order in which the pieces are handed out."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from merge_cosim.cosim.loop import Effort
from merge_cosim.cosim.scoring import Rules
from merge_cosim.encounter import Encounters
from merge_cosim.experiments.work import Batch
from merge_cosim.units import DT, FloatArray

PIECE_CASES = 1_000
"""Most cases of one piece: enough to keep the tiles busy, few enough to lose little when interrupted."""
USUAL_ACCELERATION = 1.0
"""Acceleration [m/s^2] by which the length of a case is guessed."""


@dataclass(frozen=True)
class Piece:
    """A stretch of a batch's cases: what is handed to a process, and stored, as a whole.

    Attributes:
        name: Number of the batch and of the piece in it; the same in every run of the sweep.
        whole: The batch.
        first, last: The cases `first` to `last - 1`.
        cycles: Expected cycles of all its cases.
    """

    name: str
    whole: Batch
    first: int
    last: int
    cycles: float

    def __len__(self) -> int:
        return self.last - self.first

    def batch(self) -> Batch:
        """The stretch as a batch of its own; made only now, so that a million cases are not held twice."""
        return replace(self.whole, encounters=self.whole.encounters.part(self.first, self.last), left_out=())

    def __str__(self) -> str:
        cases = self.whole.encounters.case
        return (
            f"{self.whole.scenario.name}, {self.whole.method.name}, cases {cases[self.first]} to {cases[self.last - 1]}"
        )


def cut(batches: Sequence[Batch], most: int = PIECE_CASES) -> Iterator[Piece]:
    """Cut batches into pieces of at most `most` cases, as even as can be."""
    cycles: dict[tuple[int, Rules], FloatArray] = {}
    for number, batch in enumerate(batches):
        key = (id(batch.encounters), batch.scenario.test)
        if key not in cycles:
            cycles[key] = np.concatenate([[0.0], np.cumsum(expected_cycles(batch.encounters, batch.scenario.test))])
        n = len(batch.encounters)
        ends = np.linspace(0, n, -(-n // most) + 1).astype(np.int64)
        for piece, (first, last) in enumerate(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)):
            expected = float(cycles[key][last] - cycles[key][first])
            yield Piece(f"{number:04d}-{piece:05d}", batch, first, last, expected)


def expected_cycles(encounters: Encounters, rules: Rules) -> FloatArray:
    """Rough length of each case: both cars accelerate to the merging point, then it is scored; shape (n,)."""
    arrivals = [
        (np.sqrt(speed**2 + 2 * USUAL_ACCELERATION * np.maximum(-station, 0.0)) - speed) / USUAL_ACCELERATION
        for station, speed in (
            (encounters.host_station, encounters.host_speed),
            (encounters.merging_station, encounters.merging_speed),
        )
    ]
    expected: FloatArray = np.minimum(np.maximum(*arrivals) + rules.horizon, rules.time_out) / DT
    return expected


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

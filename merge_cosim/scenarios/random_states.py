"""Random initial states that are drawn only where they are needed: ten million of them take no room."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.scenarios.sources import Grid, Random

SOURCE = "random"
BLOCK = 4_096
"""Cases that are drawn together where some of them are wanted."""


@dataclass(frozen=True)
class RandomStates:
    """A stretch of the cases of a random source.

    Attributes:
        states: The source.
        first, last: The cases `first` to `last - 1`.
    """

    states: Random
    first: int
    last: int

    @classmethod
    def of(cls, states: Random) -> Self:
        """All cases of a source."""
        return cls(states, 0, states.count)

    def __len__(self) -> int:
        return self.last - self.first

    def part(self, first: int, last: int) -> Self:
        """The cases `first` to `last - 1` of these."""
        return replace(self, first=self.first + first, last=self.first + last)

    def take(self, rows: IntArray) -> Encounters:
        """The chosen cases, in that order."""
        order = np.argsort(rows, kind="stable")
        blocks = rows[order] // BLOCK
        parts = [
            self.part(block * BLOCK, min((block + 1) * BLOCK, len(self))).encounters().take(rows[own] - block * BLOCK)
            for block, own in ((int(one), order[blocks == one]) for one in np.unique(blocks))
        ]
        return Encounters.concatenate(parts).take(np.argsort(order))

    def find(self, case: str) -> int | None:
        """Number of a case by its name; None if it is not among these."""
        named = re.fullmatch(r"r(\d{7})", case)
        number = int(named[1]) - self.first if named else -1
        return number if 0 <= number < len(self) else None

    @property
    def host_stations(self) -> FloatArray:
        """The ends of the range of the hosts' initial stations [m], shape (2,)."""
        offset = self.states.host_offset
        return self.states.merging_station + np.array([offset.first, offset.last])

    @property
    def digest(self) -> str:
        """A short hash of what they are drawn from."""
        return hashlib.sha256(f"{self.states!r} {self.first} {self.last}".encode()).hexdigest()[:16]

    def encounters(self) -> Encounters:
        """The cases; each is the same whichever stretch it is drawn in, and however many there are in all."""
        states = self.states
        spans = (states.host_offset, states.host_speed, states.merging_speed)
        low, width = np.array([(span.first, span.last - span.first) for span in spans]).T
        bits = np.random.PCG64(states.seed)
        bits.advance(len(spans) * self.first)  # of which each number takes one
        shares = np.random.Generator(bits).random((len(self), len(spans)))
        offset, host_speed, merging_speed = (low + width * shares).T.copy()
        names = [f"r{number:07d}" for number in range(self.first, self.last)]
        return designed_encounters(states, names, SOURCE, offset, host_speed, merging_speed)


def designed_encounters(
    states: Grid | Random,
    names: Sequence[str],
    source: str,
    offset: FloatArray,
    host_speed: FloatArray,
    merging_speed: FloatArray,
) -> Encounters:
    """Encounters that differ in the host's offset [m] and in both speeds [m/s], shape (n,) each."""
    return Encounters.unlogged(
        np.array(names),
        "designed",
        source,
        host_station=states.merging_station + offset,
        host_speed=host_speed,
        host_length=states.length,
        merging_station=states.merging_station,
        merging_speed=merging_speed,
        merging_length=states.length,
    )

"""What the encounters of a batch go through: recorded cycle by cycle, laid end to end when they are over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import BoolArray, FloatArray, IntArray

DECIMALS = 6
"""What is observed is rounded to 1e-6 m and m/s: the designed grid is full of ties that the last bits would break."""


class Recorder:
    """Keeps the last cycles of all encounters of a batch, as many as the longest encounter has.

    Attributes:
        lengths: Lengths of hosts and merging cars [m], shape (2, count).
    """

    def __init__(self, count: int, longest: int) -> None:
        """Make room for `count` encounters of at most `longest` cycles."""
        self.lengths = np.ones((2, count))
        self._cycles = np.zeros((longest + 1, 5, count))
        shown = self._cycles.view()
        shown.flags.writeable = False
        self._seen = [
            Observation(host, host_speed, merging, merging_speed, *self.lengths)
            for host, merging, host_speed, merging_speed, _ in shown
        ]
        self._now = 0

    @property
    def seen(self) -> Observation:
        """The present cycle, rounded; it is made once for all, and shows what is placed later in the same cycle."""
        return self._seen[self._now]

    def believed(self, log_odds: FloatArray) -> None:
        """Keep the beliefs of the present cycle, shape (count,)."""
        self._cycles[self._now, 4] = log_odds

    def moved(self, state: FloatArray) -> None:
        """Go on to the next cycle, with the world's state."""
        self._now = (self._now + 1) % len(self._cycles)
        state.round(DECIMALS, out=self._cycles[self._now, :4])

    def placed(self, rows: IntArray, start: FloatArray) -> None:
        """Begin encounters at `rows` in the present cycle, from `Encounters.start`; the old ones' last state goes."""
        self._cycles[self._now][:4, rows] = start[:4].round(DECIMALS)
        self.lengths[:, rows] = start[4:]

    def track(self, row: int, cycles: int) -> FloatArray:
        """The states and beliefs of the last `cycles` cycles at a row, and the present one; shape (5, cycles + 1)."""
        first, now = self._now - cycles, self._now + 1
        if first >= 0:
            return self._cycles[first:now, :, row].T.copy()
        return np.concatenate([self._cycles[first:, :, row].T, self._cycles[:now, :, row].T], axis=1)


@dataclass(frozen=True)
class Tracks:
    """Finished encounters from the first state to the last, laid end to end: m encounters, N states.

    Attributes:
        states: All states, shape (N,) each.
        log_odds: The belief in each state; an encounter's last state has none, and what stands there means nothing.
        case: Index of each encounter's case, shape (m,).
        cycles: Number of cycles of each encounter, at least 1, one less than it has states; shape (m,).
    """

    states: Observation
    log_odds: FloatArray
    case: IntArray
    cycles: IntArray

    @classmethod
    def of(cls, encounters: Encounters, cases: Sequence[int], tracks: Sequence[FloatArray]) -> Tracks:
        """Lay the recorded `tracks` of `cases` end to end."""
        case = np.array(cases, dtype=np.int64)
        sizes = np.array([track.shape[1] for track in tracks], dtype=np.int64)
        host_station, merging_station, host_speed, merging_speed, log_odds = np.concatenate(
            [np.empty((5, 0)), *tracks], axis=1
        )
        lengths = np.repeat(encounters.start[4:, case], sizes, axis=1)
        states = Observation(host_station, host_speed, merging_station, merging_speed, *lengths)
        return cls(states, log_odds, case, sizes - 1)

    @cached_property
    def last(self) -> IntArray:
        """Where each encounter's last state is, shape (m,)."""
        return np.cumsum(self.cycles + 1) - 1

    @cached_property
    def first(self) -> IntArray:
        """Where each encounter's first state is, shape (m,)."""
        return self.last - self.cycles

    @cached_property
    def encounter(self) -> IntArray:
        """Which of the m encounters each state belongs to, shape (N,)."""
        return np.repeat(np.arange(len(self.cycles)), self.cycles + 1)

    @cached_property
    def age(self) -> IntArray:
        """The cycle of each state, counted from its encounter's start, shape (N,)."""
        return np.arange(len(self.log_odds)) - self.first[self.encounter]

    def reached(self, where: BoolArray) -> IntArray:
        """The first cycle of each encounter in which something holds; `NEVER` if in none. Shape (m,)."""
        return np.minimum.reduceat(np.where(where, self.age, NEVER), self.first)

    def until(self, cycles: IntArray) -> Tracks:
        """The encounters up to the given cycles, shape (m,)."""
        kept = self.age <= cycles[self.encounter]
        states = Observation(*(getattr(self.states, field.name)[kept] for field in fields(Observation)))
        return Tracks(states, self.log_odds[kept], self.case, cycles)

    def fill(self, value: float) -> FloatArray:
        """A measure with the same value for every encounter, shape (m,)."""
        return np.full(len(self.cycles), value)

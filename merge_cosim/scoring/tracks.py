"""Recorded encounters laid end to end: what every measure is computed from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import BoolArray, FloatArray, IntArray

HOST_STATION, MERGING_STATION, HOST_SPEED, MERGING_SPEED, LOG_ODDS, COMMAND = range(6)
"""Rows of a recorded track: the state [m, m/s], the log-odds, the host's commanded speed [m/s]; then what the world
records of the cars around."""
RECORDED = 6


@dataclass(frozen=True)
class Tracks:
    """Finished encounters from the first state to the last, laid end to end: m encounters, N states.

    Attributes:
        states: All states, shape (N,) each.
        log_odds: The belief in each state; an encounter's last state has none, and its value is arbitrary.
        case: Index of each encounter's case, shape (m,).
        cycles: Number of cycles of each encounter, at least 1, one less than it has states; shape (m,).
        around: What the world recorded beside the states, by channel, shape (N,) each.
    """

    states: Observation
    log_odds: FloatArray
    case: IntArray
    cycles: IntArray
    around: dict[str, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        encounters: Encounters,
        cases: Sequence[int],
        tracks: Sequence[FloatArray],
        channels: Sequence[str] = (),
    ) -> Tracks:
        """Lay the recorded tracks of some cases end to end.

        Args:
            encounters: All encounters.
            cases: Indices of the recorded ones.
            tracks: Their records, shape (RECORDED + channels, cycles + 1) each.
            channels: Names of what the world recorded beside the states.
        """
        sizes = np.array([track.shape[1] for track in tracks], dtype=np.int64)
        rows = np.concatenate([np.empty((RECORDED + len(channels), 0)), *tracks], axis=1)
        return cls.of_rows(encounters, np.array(cases, dtype=np.int64), sizes - 1, rows, channels)

    @classmethod
    def of_rows(
        cls, encounters: Encounters, case: IntArray, cycles: IntArray, rows: FloatArray, channels: Sequence[str] = ()
    ) -> Tracks:
        """The same of records that lie end to end already, shape (RECORDED + channels, N)."""
        lengths = np.repeat(encounters.start[4:, case], cycles + 1, axis=1)
        states = Observation(rows[HOST_STATION], rows[HOST_SPEED], rows[MERGING_STATION], rows[MERGING_SPEED], *lengths)
        around = dict(zip(channels, rows[RECORDED:], strict=True))
        return cls(states, rows[LOG_ODDS], case, cycles, around)

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
        return np.arange(len(self.log_odds)) - np.repeat(self.first, self.cycles + 1)

    def reached(self, where: BoolArray) -> IntArray:
        """The first cycle of each encounter in which something holds; `NEVER` if in none. Shape (m,)."""
        places = np.flatnonzero(where)
        if not len(places):
            return np.full(len(self.cycles), NEVER)
        place = places[np.minimum(np.searchsorted(places, self.first), len(places) - 1)]
        return np.where((place >= self.first) & (place <= self.last), place - self.first, NEVER)

    def fill(self, value: float) -> FloatArray:
        """A measure with the same value for every encounter, shape (m,)."""
        return np.full(len(self.cycles), value)

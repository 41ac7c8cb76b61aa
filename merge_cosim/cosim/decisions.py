"""What was decided and believed on the way to the merging point: flips, since when, and the log-odds at fixed gates."""

from __future__ import annotations

import numpy as np

from merge_cosim.observation import Observation
from merge_cosim.units import TOLERANCE, BoolArray, FloatArray, IntArray, time_to_arrival

GATES = (110, 70, 40, 20)
"""Distances of the merging car to the merging point [m] at which beliefs are kept, from far to near."""
_LINES = np.array([*(-gate - TOLERANCE for gate in GATES), np.inf])


DECISIONS = {
    "decision_flips": 0.0,
    "last_decision": -1.0,
    "decided_from": 0.0,
    **{f"log_odds_{gate}": np.nan for gate in GATES},
    **{f"arrival_lead_{gate}": np.nan for gate in GATES},
}
"""What is kept, and its value at the start. `last_decision`: 1 NOT_YIELD, 0 YIELD, -1 none; `decided_from`: the cycle
since which it stands; `log_odds_G` and `arrival_lead_G` (T_h - T_m [s]): of the first cycle in which the merging car is
G m away or less, NaN where it started nearer or a car was through."""


class Decisions:
    """Keeps the decisions of a batch; they count while neither car has reached the merging point.

    Attributes:
        columns: Those of `DECISIONS`, shape (count,) each.
    """

    def __init__(self, block: FloatArray) -> None:
        """Take the place for `DECISIONS`, shape (len(DECISIONS), count), filled with their values at the start."""
        count = block.shape[1]
        self.columns = dict(zip(DECISIONS, block, strict=True))
        self._at_gate = block[-2 * len(GATES) :].reshape(2, len(GATES), count)
        self._next = np.full(count, -1)
        self._line = np.full(count, -np.inf)

    def reset(self, rows: IntArray) -> None:
        """Begin anew at `rows`; the block has been reset."""
        self._next[rows] = -1
        self._line[rows] = -np.inf

    def decided(self, age: IntArray, now: Observation, log_odds: FloatArray, not_yield: BoolArray) -> None:
        """Take in the belief and the decision of the present cycle."""
        c = self.columns
        still_open = np.maximum(now.host_station, now.merging_station) < -TOLERANCE
        rows = np.flatnonzero(still_open & (c["last_decision"] != not_yield))
        if len(rows):
            c["decision_flips"][rows] += c["last_decision"][rows] >= 0
            c["last_decision"][rows] = not_yield[rows]
            c["decided_from"][rows] = age[rows]
        rows = np.flatnonzero(now.merging_station >= self._line)
        if len(rows):
            self._take_gates(rows, now, np.where(still_open, log_odds, np.nan))

    def _take_gates(self, rows: IntArray, now: Observation, log_odds: FloatArray) -> None:
        station, gate = now.merging_station[rows], self._next[rows]
        new = gate < 0
        if new.any():  # the first cycle: what he is nearer than is passed already; exactly at a gate is at it
            begin = np.searchsorted(_LINES + 2 * TOLERANCE, station[new], side="left")
            self._next[rows[new]], self._line[rows[new]] = begin, _LINES[begin]
            rows = rows[station >= self._line[rows]]
            station, gate = now.merging_station[rows], self._next[rows]
        lead = time_to_arrival(now.host_station[rows], now.host_speed[rows])
        lead -= time_to_arrival(station, now.merging_speed[rows])
        self._at_gate[0, gate, rows] = log_odds[rows]
        self._at_gate[1, gate, rows] = np.where(np.isnan(log_odds[rows]), np.nan, lead)
        self._next[rows] = gate + 1
        self._line[rows] = _LINES[gate + 1]

"""The record of a running batch: the last cycles of every slot, and traces of single encounters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from merge_cosim.core.observation import DECIMALS, Observation
from merge_cosim.core.units import DT, FloatArray, IntArray
from merge_cosim.scoring.tracks import (
    COMMAND,
    HOST_SPEED,
    HOST_STATION,
    LOG_ODDS,
    MERGING_SPEED,
    MERGING_STATION,
    RECORDED,
)


class Recorder:
    """A ring of the last cycles of all slots, as many as the longest encounter has.

    Attributes:
        lengths: Lengths of hosts and merging cars [m], shape (2, slots).
    """

    def __init__(self, slots: int, longest: int, channels: int = 0, of_controller: int = 0) -> None:
        """Make room for `slots` encounters of at most `longest` cycles.

        Beside the states: `channels` rows of the world, and `of_controller` of the controller.
        """
        self.lengths = np.ones((2, slots))
        self._of_controller = RECORDED + channels
        self._past: list[tuple[FloatArray, IntArray]] = []
        self._columns = np.arange(slots)
        """The slot that each column was before any `thin`; the same of the cycles before each is in `_past`."""
        self._use(np.zeros((longest + 1, self._of_controller + of_controller, slots)))
        self._now = 0

    def _use(self, cycles: FloatArray) -> None:
        self._cycles = cycles
        self._shown = cycles.view()
        self._shown.flags.writeable = False
        self._seen: list[Observation | None] = [None] * len(cycles)

    @property
    def seen(self) -> Observation:
        """The present cycle; a view of the ring, so encounters that begin later in this cycle appear in it."""
        found = self._seen[self._now]
        if found is None:
            one = self._shown[self._now]
            state = one[HOST_STATION], one[HOST_SPEED], one[MERGING_STATION], one[MERGING_SPEED]
            found = self._seen[self._now] = Observation(*state, *self.lengths)
        return found

    def decided(self, log_odds: FloatArray, command: FloatArray) -> None:
        """Keep the beliefs and the hosts' commanded speeds [m/s] of the present cycle, shape (slots,) each."""
        now = self._cycles[self._now]
        now[LOG_ODDS], now[COMMAND] = log_odds, command

    def record_channels(self, values: FloatArray) -> None:
        """Keep the controller's channels of the present cycle, shape (channels, at least slots)."""
        now = self._cycles[self._now, self._of_controller :]
        now[:] = values[:, : now.shape[1]]

    def next_cycle(self) -> tuple[FloatArray, FloatArray]:
        """Go on to the next cycle: where its states and channels are to be written."""
        self._now = (self._now + 1) % len(self._cycles)
        now = self._cycles[self._now]
        return now[:LOG_ODDS], now[RECORDED : self._of_controller]

    def begun(self, slots: IntArray, start: FloatArray, around: FloatArray) -> None:
        """Begin encounters in the present cycle; the last state of the old ones is overwritten."""
        now = self._cycles[self._now]
        now[:LOG_ODDS, slots] = start[:4].round(DECIMALS)
        if len(around):
            now[RECORDED : self._of_controller, slots] = around
        self.lengths[:, slots] = start[4:]

    def track(self, slot: int, cycles: int) -> FloatArray:
        """The record of the last `cycles` cycles of a slot and of the present one, (rows, cycles + 1)."""
        first, now = self._now - cycles, self._now + 1
        if first >= 0:
            return self._cycles[first:now, :, slot].T.copy()
        return np.concatenate([self._cycles[first:, :, slot].T, self._cycles[:now, :, slot].T], axis=1)

    def states(self, track: FloatArray, slot: int) -> Observation:
        """The states of a slot's track, shape (cycles + 1,) each."""
        lengths = np.repeat(self.lengths[:, [slot]], track.shape[1], axis=1)
        rows = (HOST_STATION, HOST_SPEED, MERGING_STATION, MERGING_SPEED)
        return Observation(*(track[row] for row in rows), *lengths)

    def thin(self, slots: IntArray) -> None:
        """Go on with the encounters in `slots` alone, in that order, all of which began in the very first cycle."""
        self._past.append((self._cycles[: self._now + 1], self._columns))
        self._columns = self._columns[slots]
        self.lengths = self.lengths[:, slots]
        left = self._cycles[self._now :]
        thinned = np.zeros((*left.shape[:2], len(slots)))
        thinned[0] = left[0].take(slots, axis=1)
        self._use(thinned)
        self._now = 0

    def from_the_start(self, slots: slice, cycles: IntArray) -> FloatArray:
        """Records of some slots end to end, in each of which one encounter began in the very first cycle, (rows, N).

        Args:
            slots: The k slots, as they were before any `thin`, which must have kept their order.
            cycles: Cycles of each, shape (k,); the ring holds all of them.
        """
        longest, first = int(cycles.max()) + 1, 0
        block = np.empty((self._cycles.shape[1], len(cycles), longest))
        for held, columns in (*self._past, (self._cycles, self._columns)):
            here = slice(*np.searchsorted(columns, (slots.start, slots.stop)).tolist())
            part = held[: longest - first, :, here].transpose(1, 2, 0)
            after = first + part.shape[2]
            if part.shape[1] == len(cycles):
                block[:, :, first:after] = part
            else:
                block[:, columns[here] - slots.start, first:after] = part
            first = after - 1  # the cycle in which some were left out is in both records
        wanted = np.flatnonzero(np.arange(longest) <= cycles[:, None])
        return block.reshape(len(block), -1).take(wanted, axis=1)

    def make_room(self, slots: int, longest: int) -> None:
        """Grow to so many slots, and to encounters of so many cycles; what is recorded stays."""
        length, rows, held = self._cycles.shape
        if slots <= held and longest < length:
            return
        wanted = max(length + length // 4, longest + 1) if longest >= length else length
        grown = np.zeros((wanted, rows, max(slots, held)))
        order = np.arange(self._now - length + 1, self._now + 1)
        grown[:length, :, :held] = self._cycles[order]
        lengths = np.ones((2, grown.shape[2]))
        lengths[:, :held] = self.lengths
        self.lengths, self._now = lengths, length - 1
        self._use(grown)


def trace_of(track: FloatArray, channels: Sequence[str], begun_at: float) -> pd.DataFrame:
    """The record of one encounter as a table, one row per cycle in which something was decided.

    Args:
        track: Its record, shape (RECORDED + channels, cycles + 1).
        channels: Names of what the world and the controller recorded.
        begun_at: Time at which it began [s].
    """
    decided = track[:, :-1]
    columns = {
        "time_s": (begun_at + np.arange(decided.shape[1]) * DT).round(9),
        "host_station_m": decided[HOST_STATION],
        "host_speed_m_s": decided[HOST_SPEED],
        "host_acceleration_m_s2": (decided[COMMAND] - decided[HOST_SPEED]) / DT,
        "merging_station_m": decided[MERGING_STATION],
        "merging_speed_m_s": decided[MERGING_SPEED],
        "log_odds": decided[LOG_ODDS],
        "not_yield": (decided[LOG_ODDS] >= 0.0).astype(float),
        **dict(zip(channels, decided[RECORDED:], strict=True)),
    }
    return pd.DataFrame(columns)

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
        self._use(np.zeros((longest + 1, self._of_controller + of_controller, slots)))
        self._now = 0

    def _use(self, cycles: FloatArray) -> None:
        self._cycles = cycles
        shown = cycles.view()
        shown.flags.writeable = False
        self._seen = [
            Observation(one[HOST_STATION], one[HOST_SPEED], one[MERGING_STATION], one[MERGING_SPEED], *self.lengths)
            for one in shown
        ]

    @property
    def seen(self) -> Observation:
        """The present cycle; a view of the ring, so encounters that begin later in this cycle appear in it."""
        return self._seen[self._now]

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

    def from_the_start(self, slots: slice, cycles: IntArray) -> FloatArray:
        """Records of some slots end to end, in each of which one encounter began in the very first cycle, (rows, N).

        Args:
            slots: The k slots.
            cycles: Cycles of each, shape (k,); the ring holds all of them.
        """
        longest = int(cycles.max()) + 1
        block = np.ascontiguousarray(self._cycles[:longest, :, slots].transpose(1, 2, 0))
        held = np.flatnonzero(np.arange(longest) <= cycles[:, None])
        return block.reshape(len(block), -1).take(held, axis=1)

    def make_room(self, slots: int, longest: int) -> None:
        """Grow to so many slots, and to encounters of so many cycles; what is recorded stays."""
        length, rows, held = self._cycles.shape
        if slots <= held and longest < length:
            return
        grown = np.zeros((max(2 * length if longest >= length else length, longest + 1), rows, max(slots, held)))
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

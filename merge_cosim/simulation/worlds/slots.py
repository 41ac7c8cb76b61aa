"""A method's batch for meetings that come and go."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.worlds.meetings import Meeting

ROWS = 32
"""Rows of a slots: a batch has a fixed size, so a controller takes another slots when its own are full."""
_NOBODY = np.array([-1e3, 10.0, -1e3, 10.0, 5.0, 5.0])
"""State of a row without a meeting: far away, and finite."""


class Decided(NamedTuple):
    """What a method makes of a meeting in one cycle: its log-odds, and the host's acceleration [m/s^2]."""

    meeting: Meeting
    log_odds: float
    acceleration: float


class SlotBatch:
    """`ROWS` rows of a method's batch, each of which holds a meeting or nobody."""

    def __init__(self, driver: HostDriver, setting: Setting) -> None:
        """Take a method of its own."""
        self._driver = driver
        driver.start(ROWS, setting)
        self._seen = np.repeat(_NOBODY[:, None], ROWS, axis=1)
        self._free = list(range(ROWS))[::-1]
        self._rows: dict[Meeting, int] = {}

    @property
    def is_full(self) -> bool:
        """There is no row left."""
        return not self._free

    def begin(self, meeting: Meeting, seed: int) -> None:
        """Give a meeting a row."""
        row = self._free.pop()
        self._rows[meeting] = row
        self._seen[4:, row] = meeting.host.length, meeting.merging.length
        key = stream_keys(np.array([f"{meeting.host.name} {meeting.merging.name}"]), seed)
        self._driver.reset(np.array([row]), np.array([int(Intention.UNKNOWN)]), key)

    def end(self, meeting: Meeting) -> None:
        """Take its row back."""
        row = self._rows.pop(meeting)
        self._seen[:, row] = _NOBODY
        self._free.append(row)

    def decide(self, merging_point: float) -> Iterator[Decided]:
        """Estimate and control for one cycle.

        Args:
            merging_point: The ramp's usual one [m past the gore].
        """
        if not self._rows:
            return
        for meeting, row in self._rows.items():
            point, host, merging = meeting.merging_point(merging_point), meeting.host, meeting.merging
            self._seen[:4, row] = host.x - point, host.speed, merging.x - point, merging.speed
        log_odds, acceleration = self._driver.decide(Observation(*self._seen))
        for meeting, row in self._rows.items():
            yield Decided(meeting, float(log_odds[row]), float(acceleration[row]))

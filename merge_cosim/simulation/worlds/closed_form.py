"""The closed form as a world: cars move as commanded, `s' = s + v dt`, without SUMO."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from merge_cosim.core.observation import DECIMALS
from merge_cosim.core.units import DT, FloatArray, IntArray
from merge_cosim.simulation.worlds.base import GivenWorld, WorldKind


class ClosedForm:
    """Stations and speeds of both cars in each slot, moved by `s' = s + v dt`.

    Attributes:
        state: Stations of hosts and merging cars [m], then their speeds [m/s], shape (4, slots).
    """

    def __init__(self, slots: int) -> None:
        self.state = np.zeros((4, slots))

    def move(self, speeds: FloatArray) -> None:
        """Move all cars by one cycle with the given speeds [m/s], shape (2, slots)."""
        self.state[2:] = speeds
        self.state[:2] += speeds * DT


class ClosedFormWorld(GivenWorld):
    """Moves one host and one merging car in each slot by the closed form."""

    kind: ClassVar[WorldKind] = "closed-form"
    can_thin: ClassVar[bool] = True

    def __init__(self, slots: int) -> None:
        super().__init__(slots)
        self._cars = ClosedForm(slots)
        self._speeds = np.zeros((2, slots))

    def place(self, slots: IntArray, cases: IntArray) -> FloatArray:
        """See `GivenWorld`."""
        self._cars.state[:, slots] = self.encounters.start[:4, cases]
        return np.empty((0, len(slots)))

    def thin(self, slots: IntArray) -> None:
        """See `World`."""
        super().thin(slots)
        self._cars.state = self._cars.state.take(slots, axis=1)

    def command(self, speeds: FloatArray) -> None:
        """See `World`."""
        self._speeds = speeds

    def step(self) -> None:
        """See `World`."""
        self._cars.move(self._speeds)

    def observe(self, state: FloatArray, around: FloatArray) -> None:
        """See `World`."""
        self._cars.state.round(DECIMALS, out=state)

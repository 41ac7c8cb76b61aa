"""The base class of merging cars: how the other driver drives."""

from __future__ import annotations

from abc import abstractmethod
from typing import TypeVar

import numpy as np

from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.registry import Component, Registry
from merge_cosim.core.units import FloatArray, IntArray


class MergingCar(Component):
    """Drives the merging cars of a batch of encounters; parameters are dataclass fields."""

    def start(self, encounters: Encounters, count: int, setting: Setting) -> None:
        """Make room for `count` encounters at a time, drawn from `encounters`, and forget everything before."""
        self.setting = setting

    def reset(self, rows: IntArray, cases: IntArray) -> None:
        """Begin the encounters `cases` (indices into those of `start`) at `rows` of the batch."""

    @abstractmethod
    def next_speed(self, age: IntArray, now: Observation) -> FloatArray:
        """Return the speed [m/s] to drive with in this cycle, shape (n,).

        Args:
            age: Cycles since each encounter's start, shape (n,).
            now: The true state of both cars.
        """

    def intentions(self, encounters: Encounters) -> IntArray:
        """The intentions of the drivers of some encounters (`Intention`), where they are scripted; shape (n,)."""
        return np.full(len(encounters), int(Intention.UNKNOWN))

    def observed_speed(self, age: IntArray, speed: FloatArray) -> FloatArray:
        """The speed [m/s] that the host's sensors report of the merging car; the true one unless a log has another."""
        return speed


merging_cars: Registry[MergingCar] = Registry("merging car", "merge_cosim.merging_cars", MergingCar)

M = TypeVar("M", bound=MergingCar)


def merging_car(cls: type[M]) -> type[M]:
    """Class decorator: make a class a merging car of its name; its annotated attributes are parameters."""
    merging_cars.register(cls)
    return cls

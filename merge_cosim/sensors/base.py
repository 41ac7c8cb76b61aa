"""The base class of sensors: from the true state of the merging car to what the host observes of it."""

from __future__ import annotations

from abc import abstractmethod
from typing import TypeVar

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.registry import Component, Registry
from merge_cosim.core.units import IntArray


class Sensor(Component):
    """Changes what a method sees, for a batch of encounters at once; parameters are dataclass fields.

    Work per cycle must not grow with the history, and each encounter's result must not depend on its neighbours in the
    batch. What it gives must be finite. Worlds and scoring keep the true state.
    """

    def start(self, count: int, setting: Setting) -> None:
        """Make room for a batch of `count` encounters and forget everything before."""
        self.setting = setting

    def declared(self, setting: Setting) -> Setting:
        """The setting that methods are given: with the age of the reports, where they carry time stamps."""
        return setting

    def reset(self, rows: IntArray, keys: Keys) -> None:
        """Forget the encounters at `rows` of the batch; new ones begin there.

        Args:
            rows: Where they begin, shape (m,).
            keys: Key of each one's random stream (`merge_cosim.core.random_streams`), shape (m,).
        """

    @abstractmethod
    def observe(self, now: Observation) -> Observation:
        """Take in one cycle and return what the host observes in it.

        Args:
            now: The state of both cars; the merging car's speed in a replay is the log's observable speed.
        """


sensors: Registry[Sensor] = Registry("sensor", "merge_cosim.sensors", Sensor)

S = TypeVar("S", bound=Sensor)


def sensor(cls: type[S]) -> type[S]:
    """Class decorator: make a class a sensor that is known by its name; its annotated attributes are parameters."""
    sensors.register(cls)
    return cls

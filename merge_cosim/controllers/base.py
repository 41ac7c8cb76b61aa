"""The base class of controllers: from the decision to the host's acceleration."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, TypeVar

import numpy as np

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.registry import Component, Registry
from merge_cosim.core.units import BoolArray, FloatArray, IntArray
from merge_cosim.estimators.base import Estimator


class Controller(Component):
    """Computes the host's acceleration from observation and log-odds; parameters are dataclass fields.

    Attributes:
        default_estimator: Estimator of a method that is named by its controller only.
    """

    default_estimator: ClassVar[str] = "acc"

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of further values that traces record of each cycle, such as the expected costs of the policies."""
        return ()

    def taken_from(self, estimator: Estimator) -> dict[str, Any]:
        """Parameters, by name, whose values are the estimator's where the two are paired; they are set only there."""
        return {}

    def pair(self, estimator: Estimator) -> None:
        """Called with the method's estimator before `start`, for controllers that use more of it than its log-odds."""

    def start(self, count: int, setting: Setting) -> None:
        """Make room for a batch of `count` encounters and forget everything before."""
        self.setting = setting

    def reset(self, rows: IntArray) -> None:
        """Forget the encounters at `rows` of the batch; new ones begin there."""

    def look_around(self, around: FloatArray) -> None:
        """Called each cycle before `command` in worlds that have other cars.

        Args:
            around: Gap from the host to the car ahead in its lane [m], inf without one, and that car's speed [m/s]; how
                far the merging car can go on beside the host lane, in which it may come in anywhere [m], 0 where it
                comes in at station 0; shape (3, n).
        """

    @abstractmethod
    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """Return the host's acceleration [m/s^2], shape (n,).

        Args:
            seen: The present cycle.
            log_odds: `log P(NOT_YIELD) - log P(YIELD)`, shape (n,).
            target: The merging car is the one to keep distance to, shape (n,).
        """

    def channel_values(self) -> FloatArray:
        """Values of `channels` in the cycle of the last command, shape (channels, n); NaN where there is none."""
        return np.zeros((0, 0))


controllers: Registry[Controller] = Registry("controller", "merge_cosim.controllers", Controller)

C = TypeVar("C", bound=Controller)


def controller(cls: type[C]) -> type[C]:
    """Class decorator: make a class a controller that is known by its name; its annotated attributes are parameters."""
    controllers.register(cls)
    return cls

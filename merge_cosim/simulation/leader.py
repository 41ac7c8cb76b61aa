"""How a host drives behind the car ahead in its lane, and freely: one rule for every world with other cars in it."""

from __future__ import annotations

from copy import deepcopy

import numpy as np

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import Controller
from merge_cosim.controllers.law import FollowingLaw
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import FloatArray


class LeaderRule:
    """Keeps a host behind its leader by its controller's law of following, or by `acc` where the controller has none.

    Attributes:
        law: The law of following.
    """

    def __init__(self, controller: Controller, setting: Setting) -> None:
        law = deepcopy(controller) if isinstance(controller, FollowingLaw) else Acc()
        law.start(1, setting)
        self.law: FollowingLaw = law
        self._limit = setting.speed_limit

    def cap(self, acceleration: FloatArray, speed: FloatArray, leader: FloatArray) -> FloatArray:
        """Bound accelerations by what keeps distance to a leader.

        Args:
            acceleration: What a host would drive without the leader [m/s^2], shape (n,).
            speed: Its speed [m/s], shape (n,).
            leader: Gap to the car ahead, bumper to bumper [m], inf without one, and its speed [m/s], shape (2, n).
        """
        gap, leader_speed = leader
        led = np.isfinite(gap)
        behind = self.law.clip(self.law.follow(np.where(led, gap, 0.0), speed, leader_speed))
        return np.where(led, np.minimum(acceleration, behind), acceleration)

    def without_merging_car(self, speed: FloatArray, leader: FloatArray) -> FloatArray:
        """Acceleration [m/s^2] of a host without a merging car: free, and no more than behind its leader."""
        return self.cap(self.law.clip(self.law.free(speed, self._limit)), speed, leader)

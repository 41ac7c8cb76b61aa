"""The laws of distance keeping and free driving that the host and the designed merging car share."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.units import Acceleration, BoolArray, Braking, FloatArray


@dataclass(kw_only=True)
class FreeDriving:
    """Driving without a car ahead: `a = k_free (v_limit - v)`, clipped to the bounds.

    Attributes:
        k_free: Gain of free driving [1/s].
        min_acceleration: Hardest braking, negative [m/s^2].
        max_acceleration: Hardest acceleration [m/s^2], more than 0: free driving ends at the speed limit.
    """

    k_free: PositiveFloat = 0.4
    min_acceleration: Braking = -4.0
    max_acceleration: Acceleration = 2.0

    def free(self, speed: FloatArray, speed_limit: float) -> FloatArray:
        """Acceleration [m/s^2] without a car ahead, before the bounds."""
        return self.k_free * (speed_limit - speed)

    def clip(self, acceleration: FloatArray) -> FloatArray:
        """Bound the acceleration to what the car can do."""
        # np.clip does the same at twice the cost
        return np.minimum(np.maximum(acceleration, self.min_acceleration), self.max_acceleration)


@dataclass(kw_only=True)
class FollowingLaw(FreeDriving, ABC):
    """What every law of following has: free driving, and the gap that is kept.

    Attributes:
        d0: Gap at standstill [m].
        headway: Time headway T [s].
    """

    d0: NonNegativeFloat = 2.0
    headway: NonNegativeFloat = 1.5

    def gap_error(self, gap: FloatArray, speed: FloatArray) -> FloatArray:
        """How much larger than wanted the gap is, `gap - (d0 + T v)` [m]."""
        return gap - (self.d0 + self.headway * speed)

    @abstractmethod
    def follow(self, gap: FloatArray, speed: FloatArray, leader_speed: FloatArray) -> FloatArray:
        """Acceleration [m/s^2] behind a leader, before the bounds; `gap` [m] may be negative."""

    def drive(
        self, led: BoolArray, gap: FloatArray, speed: FloatArray, leader_speed: FloatArray, speed_limit: float
    ) -> FloatArray:
        """Acceleration within the bounds [m/s^2]: free, and where there is a leader (`led`) no more than behind it."""
        free = self.free(speed, speed_limit)
        return self.clip(np.where(led, np.minimum(self.follow(gap, speed, leader_speed), free), free))


@dataclass(kw_only=True)
class DistanceKeeping(FollowingLaw):
    """Linear distance keeping with constant time headway, bounded by free driving (Dong, Dolan, Litkouhi 2017, ACC).

    `a = min(k_gap (gap - (d0 + T v)) + k_speed (v_lead - v), k_free (v_limit - v))`, clipped to the bounds. The papers
    give no gains; these are stated here and the same for every method.

    Attributes:
        k_gap: Gain on the gap error [1/s^2].
        k_speed: Gain on the speed difference [1/s].
    """

    k_gap: PositiveFloat = 0.23
    k_speed: PositiveFloat = 0.6

    def follow(self, gap: FloatArray, speed: FloatArray, leader_speed: FloatArray) -> FloatArray:
        """Acceleration [m/s^2] behind a leader, before the bounds; `gap` [m] may be negative."""
        return self.k_gap * self.gap_error(gap, speed) + self.k_speed * (leader_speed - speed)

"""The Intelligent Driver Model as a merging driver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import Acceleration, Braking, FloatArray, IntArray
from merge_cosim.merging_cars.ahead import Ahead, host_ahead
from merge_cosim.merging_cars.base import MergingCar, merging_cars


@merging_cars.register
@dataclass(kw_only=True)
class Idm(MergingCar):
    """Follows a host ahead, and drives freely without one, by the Intelligent Driver Model.

    `a [1 - (v / v_limit)^delta - (s* / s)^2]` with `s* = d0 + max(0, v T + v (v - v_host) / (2 sqrt(a b)))`; without a
    host ahead the last term is left out (Treiber, Hennecke, Helbing 2000). Defaults are the usual ones for freeways
    (Treiber, Kesting 2013). The driver has no intention: whether it passes first follows from the host.

    Attributes:
        acceleration: Acceleration a from standstill [m/s^2].
        braking: Comfortable braking b [m/s^2].
        exponent: Exponent delta of free driving.
        d0: Gap at standstill [m].
        headway: Time headway T [s].
        min_acceleration: Hardest braking, negative [m/s^2].
        ahead: When the host counts as ahead: `clear`, `in-lane` or `any`, as for `designed`.
    """

    name: ClassVar[str] = "idm"
    acceleration: Acceleration = 1.0
    braking: PositiveFloat = 1.5
    exponent: PositiveFloat = 4.0
    d0: NonNegativeFloat = 2.0
    headway: NonNegativeFloat = 1.0
    min_acceleration: Braking = -4.0
    ahead: Ahead = "clear"

    def next_speed(self, age: IntArray, now: Observation) -> FloatArray:
        """One step of the model."""
        speed = now.merging_speed
        closing = speed * (speed - now.host_speed) / (2.0 * np.sqrt(self.acceleration * self.braking))
        wanted = self.d0 + np.maximum(speed * self.headway + closing, 0.0)
        ahead, gap = host_ahead(now, self.ahead)
        following = np.where(ahead, wanted / np.maximum(gap, 0.1), 0.0)
        free = (speed / self.setting.speed_limit) ** self.exponent
        acceleration = self.acceleration * (1.0 - free - following**2)
        return np.maximum(speed + np.maximum(acceleration, self.min_acceleration) * self.setting.dt, 0.0)

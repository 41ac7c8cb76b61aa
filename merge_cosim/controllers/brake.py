"""Full braking in every situation: a bound that shows why failure rates by themselves say little."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from merge_cosim.controllers.base import Controller, controllers
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import BoolArray, Braking, FloatArray


@controllers.register
@dataclass(kw_only=True)
class Brake(Controller):
    """Brakes fully until the host stands.

    Attributes:
        min_acceleration: Hardest braking, negative [m/s^2].
    """

    name: ClassVar[str] = "brake"
    memory = ()
    min_acceleration: Braking = -4.0

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """The same full braking everywhere."""
        return np.full(len(seen.host_speed), self.min_acceleration)

"""The acceleration that a merging driver of either intention plans, as iPCB assumes it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat, NonPositiveFloat

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import TOLERANCE, FloatArray


@dataclass(kw_only=True)
class IntendedAcceleration:
    """Mean acceleration of the merging car for each intention (after Wei, Dolan, Litkouhi 2013).

    Attributes:
        means: `fixed`: the same two accelerations everywhere. `arrival`: what brings the car to the merging point `tau`
            after (YIELD) or before (NOT_YIELD) a host that keeps its speed, `a_I = 2 (d - v T_I) / T_I^2`; where that
            would have it stop short and roll back, braking to a stop at the merging point, `-v^2 / (2 d)`.
        mean_yield: Fixed mean of a driver that yields [m/s^2].
        mean_not_yield: Fixed mean of a driver that does not yield [m/s^2].
        tau: Time between the two arrivals [s].
        merging_min_acceleration: Lower bound of the means by arrival [m/s^2].
        merging_max_acceleration: Upper bound of the means by arrival [m/s^2].
    """

    means: Literal["fixed", "arrival"] = "fixed"
    mean_yield: float = -0.5
    mean_not_yield: float = 0.5
    tau: NonNegativeFloat = 1.5
    merging_min_acceleration: NonPositiveFloat = -4.0
    merging_max_acceleration: NonNegativeFloat = 2.0

    def intended(self, seen: Observation, dt: float) -> FloatArray:
        """Return the accelerations [m/s^2], shape (2, n), indexed by `Intention`."""
        if self.means == "fixed":
            fixed = np.array([[self.mean_yield], [self.mean_not_yield]])
            return np.repeat(fixed, len(seen.merging_speed), axis=1)
        host = seen.host_arrival
        arrival = np.stack([host + self.tau, np.maximum(host - self.tau, dt)])
        arrival = np.maximum(arrival, dt)
        distance = np.maximum(-seen.merging_station, 0.0)
        way = seen.merging_speed * arrival
        needed = 2.0 * (distance - way) / arrival**2
        stopping = -(seen.merging_speed**2) / (2.0 * np.maximum(distance, TOLERANCE))
        needed = np.where((needed < 0.0) & (way > 2.0 * distance), stopping, needed)
        return np.clip(needed, self.merging_min_acceleration, self.merging_max_acceleration)

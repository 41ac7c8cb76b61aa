"""Types of merging drivers that react to the host, shared by the interactive filter and the rollouts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.observation import Setting
from merge_cosim.core.units import Acceleration, Braking

if TYPE_CHECKING:
    from merge_cosim.estimators.compiled.drivers import DriverLaw

DRIVER_TYPES = ("yield", "not_yield", "ignore", "wait", "accelerate", "late")
"""The types, in the order of every array of beliefs."""


@dataclass(kw_only=True)
class ReactingDriver:
    """What a merging driver of each type does, given the host's present arrival T_h.

    `need(T) = 2 (d - v T) / T^2` covers the way d to the merging point in the time T; where that would stop the car
    before the point, it is the stop at the point, `-v^2 / (2 d)`. `yield`: `min(need(T_h + m), 0)`. `not_yield`:
    `max(need(T_h - m), 0)`. `ignore`: 0, throughout. `wait`: goes once it arrives `critical_gap` before the host, and
    else stops at the merging point. `accelerate`: a steady acceleration up to the speed limit. `late`: 0, and from some
    way before the merging point as hard as it can. These two look at the host only once they are in the lane, the
    others but `ignore` once either car has reached the merging point; then they keep distance behind a host ahead, and
    drive freely without one. Above the speed limit every type slows down.

    Attributes:
        driver_margin: Margin m between the two arrivals [s].
        driver_min_acceleration: A driver's hardest braking, negative [m/s^2].
        driver_max_acceleration: A driver's hardest acceleration [m/s^2].
        critical_gap: Time before the host's arrival that a waiting driver needs to go [s].
        waiting_braking: Braking at which a waiting driver begins to stop [m/s^2].
        driver_headway: Time headway behind a host that has passed [s].
        driver_d0: Gap at standstill behind it [m].
        driver_k_free: Gain of free driving [1/s].
        driver_k_gap: Gain on the gap error behind a host [1/s^2].
        driver_k_speed: Gain on the speed difference to it [1/s].
    """

    driver_margin: NonNegativeFloat = 1.2
    driver_min_acceleration: Braking = -4.0
    driver_max_acceleration: Acceleration = 3.0
    critical_gap: NonNegativeFloat = 3.0
    waiting_braking: PositiveFloat = 1.5
    driver_headway: NonNegativeFloat = 0.8
    driver_d0: NonNegativeFloat = 2.0
    driver_k_free: PositiveFloat = 0.4
    driver_k_gap: PositiveFloat = 0.23
    driver_k_speed: PositiveFloat = 0.6

    def law(self, setting: Setting) -> DriverLaw:
        """The constants as the compiled loops take them."""
        from merge_cosim.estimators.compiled.drivers import DriverLaw

        return DriverLaw(
            min_acceleration=self.driver_min_acceleration,
            max_acceleration=self.driver_max_acceleration,
            critical_gap=self.critical_gap,
            waiting_braking=self.waiting_braking,
            k_free=self.driver_k_free,
            k_gap=self.driver_k_gap,
            k_speed=self.driver_k_speed,
            d0=self.driver_d0,
            headway=self.driver_headway,
            speed_limit=setting.speed_limit,
            dt=setting.dt,
        )

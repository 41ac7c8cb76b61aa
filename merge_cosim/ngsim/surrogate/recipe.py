"""What SUMO's own traffic on an NGSIM ramp is made of."""

from __future__ import annotations

from dataclasses import dataclass

from merge_cosim.sumo.vehicle_types import DRIVERS, Drivers


@dataclass(frozen=True)
class Recipe:
    """Demand, speeds and drivers of the surrogate of one site.

    Attributes:
        site: Name of the site and of the ramp.
        seeds: SUMO's random seed of each recording.
        duration: Length of a recording [s].
        warm_up: Simulated before it and thrown away [s].
        through: Cars per hour that stay on the main road, at random intervals.
        leaving: Cars per hour from the main road to the off-ramp, likewise.
        merging: Cars per hour on the on-ramp. They come at even intervals, as behind a ramp meter: cars in a bunch meet
            each other rather than hosts.
        approach_speed: Speed limit of the main lanes up to the gore [m/s].
        beside_speed: The same beside the auxiliary lane.
        onward_speed: The same beyond it.
        ramp_speed: Speed limit of the on-ramp [m/s].
        auxiliary_speed: Speed limit of the auxiliary lane [m/s].
        exit_speed: Speed limit of the off-ramp [m/s], if there is one.
        filmed_from: The on-ramp is filmed from here on [m past the gore].
        speed_factor: Spread of desired speeds: normal, mean, deviation, lowest, highest (as a factor of the limit).
        min_gap: Gap to the car ahead at standstill [m].
        assertive: How small a gap a driver accepts for a necessary lane change (`lcAssertive`).
        strategic: How early a driver changes (`lcStrategic`).
        cooperative: How willing a driver is to make room (`lcCooperative`), 0 to 1.
        speed_gain: How eager a driver is to change to a faster lane (`lcSpeedGain`).
        change_time: Length of a lane change [s]; the car counts for the new lane from its middle on.
        drivers: The kinds of drivers.
    """

    site: str
    seeds: tuple[int, ...]
    duration: float
    warm_up: float
    through: float
    leaving: float
    merging: float
    approach_speed: float
    beside_speed: float
    onward_speed: float
    ramp_speed: float
    auxiliary_speed: float
    exit_speed: float
    filmed_from: float
    speed_factor: tuple[float, float, float, float]
    min_gap: float
    assertive: float
    strategic: float
    cooperative: float
    speed_gain: float
    change_time: float
    drivers: tuple[Drivers, ...]


RECIPES = {
    "us101": Recipe(
        site="us101",
        seeds=(1, 2, 3),
        duration=900.0,
        warm_up=240.0,
        through=8800.0,
        leaving=350.0,
        merging=500.0,
        approach_speed=16.0,
        beside_speed=17.5,
        onward_speed=18.5,
        ramp_speed=17.0,
        auxiliary_speed=19.0,
        exit_speed=16.0,
        filmed_from=-34.0,
        speed_factor=(1.0, 0.2, 0.6, 1.4),
        min_gap=2.0,
        assertive=1.2,
        strategic=0.5,
        cooperative=0.6,
        speed_gain=0.5,
        change_time=3.0,
        drivers=DRIVERS,
    ),
    "i80": Recipe(
        site="i80",
        seeds=(1, 2, 3),
        duration=900.0,
        warm_up=240.0,
        through=9500.0,
        leaving=0.0,
        merging=500.0,
        approach_speed=16.0,
        beside_speed=17.0,
        onward_speed=17.5,
        ramp_speed=16.0,
        auxiliary_speed=17.5,
        exit_speed=0.0,
        filmed_from=-75.0,
        speed_factor=(1.0, 0.15, 0.7, 1.3),
        min_gap=2.0,
        assertive=1.2,
        strategic=0.5,
        cooperative=1.0,
        speed_gain=1.0,
        change_time=3.0,
        drivers=DRIVERS,
    ),
}
"""The surrogate of each site, set by hand so that the pairs come near to published figures and to the real pairs at
hand: the mean way to the lane change, speeds, the share of yielding. The speed limits are those of the model, not of
the road: they stand for the traffic of a rush hour."""

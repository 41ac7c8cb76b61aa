"""How a merging driver of each type accelerates, given where the host is: one law for the filter and for the rollouts.

Everything is scalar and compiled without reordering of sums, so that a result does not depend on the batch.
"""

from typing import NamedTuple

from merge_cosim.core.kernels import kernel

TOL = 1e-6
NEAR = 0.1
"""Way [m] below which an acceleration is no longer computed from the way left."""
YIELD, NOT_YIELD, IGNORE, WAIT, ACCELERATE, LATE = 0, 1, 2, 3, 4, 5


class DriverLaw(NamedTuple):
    """Constants of the drivers, see `merge_cosim.estimators.driver_types.ReactingDriver`."""

    min_acceleration: float
    max_acceleration: float
    critical_gap: float
    waiting_braking: float
    k_free: float
    k_gap: float
    k_speed: float
    d0: float
    headway: float
    speed_limit: float
    dt: float


@kernel
def arrival(station: float, speed: float) -> float:
    """Time [s] to reach station 0 at the present speed, as `time_to_arrival`."""
    return max(-station, 0.0) / max(speed, 0.5)


@kernel
def needed(way: float, speed: float, time: float) -> float:
    """Constant acceleration [m/s^2] that covers `way` in `time`; where that would stop short, the stop at the point."""
    if speed * time > 2.0 * way:
        return -speed * speed / (2.0 * way)
    return 2.0 * (way - speed * time) / (time * time)


@kernel
def planned(kind: int, trait: float, host_arrival: float, station: float, speed: float, law: DriverLaw) -> float:
    """Acceleration [m/s^2] that a driver of a type plans before either car has reached the merging point.

    The trait is the margin [s] of `YIELD` and `NOT_YIELD`, the acceleration [m/s^2] of `ACCELERATE`, the way to the
    merging point [m] at which `LATE` begins.
    """
    way = max(-station, NEAR)
    if kind == YIELD:
        wanted = min(needed(way, speed, max(host_arrival + trait, law.dt)), 0.0)
    elif kind == NOT_YIELD:
        wanted = max(needed(way, speed, max(host_arrival - trait, law.dt)), 0.0)
    elif kind == IGNORE:
        wanted = 0.0
    elif kind == ACCELERATE:
        wanted = trait
    elif kind == LATE:
        wanted = law.max_acceleration if way <= trait else 0.0
    elif host_arrival - arrival(station, speed) >= law.critical_gap:
        wanted = law.k_free * (law.speed_limit - speed)
    else:
        stop = -speed * speed / (2.0 * way)
        wanted = stop if stop <= -law.waiting_braking else 0.0
    return min(max(wanted, law.min_acceleration), law.max_acceleration)


@kernel
def reacting(
    kind: int,
    trait: float,
    host_station: float,
    host_speed: float,
    host_length: float,
    station: float,
    speed: float,
    law: DriverLaw,
) -> float:
    """Acceleration [m/s^2] of a driver of a type: its plan, and once a car has passed, distance keeping.

    A driver that ignores the host holds the speed throughout; one that waits lets the host's rear pass; those that
    accelerate look once they are in the lane. Who is faster than the speed limit slows down, whatever the type.
    """
    free = law.k_free * (law.speed_limit - speed)
    blind = kind in (ACCELERATE, LATE)
    if kind == IGNORE:
        wanted = 0.0
    elif (station if blind else max(host_station, station)) < -TOL:
        wanted = planned(kind, trait, arrival(host_station, host_speed), station, speed, law)
    else:
        wanted = free
        lead = host_station - station
        if kind == WAIT and station < -TOL and -TOL < lead < host_length + law.d0:
            wanted = -speed * speed / (2.0 * max(-station, NEAR))
        elif lead > TOL:
            gap = lead - host_length - law.d0 - law.headway * speed
            wanted = min(wanted, law.k_gap * gap + law.k_speed * (host_speed - speed))
    if free < 0.0:
        wanted = min(wanted, free)
    return min(max(wanted, law.min_acceleration), law.max_acceleration)

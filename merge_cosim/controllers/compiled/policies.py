"""The host's policies: what each accelerates, and the constants of the host and of the costs."""

from math import sqrt
from typing import NamedTuple

from merge_cosim.core.kernels import kernel
from merge_cosim.estimators.compiled.drivers import TOL, arrival, needed

FREE, COAST, FOLLOW, BEHIND, FIXED, SUDDEN = 0, 1, 2, 3, 4, 5
"""Policies; FIXED and SUDDEN hold an acceleration, SUDDEN with no bound on the change."""


class HostLaw(NamedTuple):
    """Constants of the host and of the costs, see `merge_cosim.controllers.rollout.Rollout`."""

    k_free: float
    k_gap: float
    k_speed: float
    d0: float
    headway: float
    min_acceleration: float
    max_acceleration: float
    behind_margin: float
    change: float
    steps: int
    step: float
    goal: float
    scored: float
    overlap: float
    spread: float
    spread_rate: float
    progress: float
    effort: float
    sudden: float
    courtesy: float
    end_braking: float
    reacts: bool


@kernel
def host_acceleration(
    policy: int,
    held: float,
    host_station: float,
    host_speed: float,
    station: float,
    speed: float,
    length: float,
    host: HostLaw,
    limit: float,
) -> float:
    """Acceleration [m/s^2] that a policy wants, within the host's bounds."""
    free = host.k_free * (limit - host_speed)
    follow = host.k_gap * (station - length - host_station - host.d0 - host.headway * host_speed) + host.k_speed * (
        speed - host_speed
    )
    if station >= -TOL:
        wanted = min(follow, free) if station - host_station >= -TOL else free
    elif policy == FREE:
        wanted = free
    elif policy == COAST:
        wanted = min(0.0, free)
    elif policy == FOLLOW:
        wanted = min(follow, free)
    elif policy == BEHIND:
        if host_station >= -TOL:
            wanted = free
        else:
            time = arrival(station, speed) + host.behind_margin
            wanted = min(needed(max(-host_station, 0.1), host_speed, time), free)
    else:
        wanted = min(held, free)
    return min(max(wanted, host.min_acceleration), host.max_acceleration)


@kernel
def time_left(way: float, speed: float, limit: float, host: HostLaw) -> float:
    """Time [s] for the way that is left after a rollout, at half of what free driving pulls then."""
    pull = min(max(0.5 * host.k_free * (limit - speed), 0.05), host.max_acceleration)
    return (sqrt(speed * speed + 2.0 * pull * way) - speed) / pull

"""Escapes: manoeuvres of the host that avoid an overlap whatever the merging driver does within stated bounds."""

from typing import NamedTuple

import numpy as np

from merge_cosim.core.kernels import kernel
from merge_cosim.core.units import BoolArray, FloatArray, IntArray
from merge_cosim.estimators.compiled.drivers import TOL

SHORT = 0.001
"""Way before the merging point [m] within which the host counts as having reached it."""
STANDS = 0.1
"""Speed [m/s] below which a driver stands."""
UNSEEN, NONE, LEFT, FORCED = -1, 0, 1, 2
"""Not looked at; no escape exists; the wanted acceleration leaves one; the acceleration was changed to leave one."""


class Bounds(NamedTuple):
    """What the host can do and the merging driver may do, see `merge_cosim.controllers.rollout.Rollout`.

    `past` is how far past a standing driver the host must be for it to start [m], -inf for one that starts at any time.
    """

    min_acceleration: float
    max_acceleration: float
    driver_braking: float
    driver_acceleration: float
    past: float
    deviations: float
    follower_braking: float
    follower_reaction: float
    speed_limit: float
    dt: float
    cycles: int


@kernel
def waits_beside(host_station: float, host_length: float, station: float, speed: float, past: float) -> bool:
    """Whether a driver stands at the merging point with the host level with it or ahead, not yet past by `past`.

    Who stands there cannot come into the lane but into the host's side, so it waits until the host has passed.
    """
    stands = speed < STANDS and -past <= station < -TOL
    return stands and -TOL <= host_station - station < host_length + past


@kernel
def escapes(
    first: float,
    then: float,
    state: FloatArray,
    low: float,
    high: float,
    since: float,
    stop: float,
    bounds: Bounds,
) -> bool:
    """Whether acceleration `first` for one cycle and `then` ever after avoids an overlap for certain.

    Until the host's front reaches the merging point the driver may do anything from `low` to `high`, so its stations
    lie between those of these two. If all of them are then upstream of the merging point, the driver comes behind: it
    may accelerate until it is in the lane, and a reaction time later brakes at least with `follower_braking`. If all
    are a length ahead, it may go on with `low`. A driver already in the lane has been there for the time `since`. A
    driver who stands beside the host waits until the host has passed, so that the host may do anything. A stop counts
    that ends at least `stop` before the merging point.
    """
    host_station, host_speed, station, speed, host_length, length = state[:6]
    station_margin, speed_margin = bounds.deviations * state[6], bounds.deviations * state[7]
    if waits_beside(host_station, host_length, station, speed, bounds.past):
        return True
    dt = bounds.dt
    top = max(bounds.speed_limit, speed + speed_margin)
    slow_station, slow_speed = station - station_margin, max(speed - speed_margin, 0.0)
    fast_station, fast_speed = station + station_margin + state[8], speed + speed_margin
    acceleration = first
    order = 0  # 1: the driver is behind, 2: ahead
    if host_station >= -SHORT:
        if fast_station < host_station - TOL:
            order = 1
        elif slow_station >= -TOL:
            order = 2
    for _ in range(bounds.cycles):
        host_speed = min(max(host_speed + acceleration * dt, 0.0), max(bounds.speed_limit, host_speed))
        host_station += host_speed * dt
        acceleration = then
        slow_speed = min(max(slow_speed + low * dt, 0.0), top)
        slow_station += slow_speed * dt
        in_lane = fast_station >= -TOL
        if order == 1 and since >= bounds.follower_reaction - TOL:
            fast_speed = max(fast_speed - bounds.follower_braking * dt, 0.0)
        else:
            fast_speed = min(max(fast_speed + high * dt, 0.0), top)
        fast_station += fast_speed * dt
        if host_station < -stop and host_speed <= 0.0:
            return True
        if host_station < -SHORT:
            continue
        if order == 0:
            if fast_station < -TOL:
                order = 1
            elif slow_station >= -TOL and slow_station - length >= host_station - TOL:
                order = 2
            else:
                return False
        if order == 1:
            since += dt if in_lane else 0.0
            if fast_station >= -TOL and host_station - host_length < fast_station - TOL:
                return False
            if since >= bounds.follower_reaction - TOL and fast_speed <= host_speed and then >= 0.0:
                return True
        else:
            if slow_station - length < host_station - TOL:
                return False
            if host_speed <= slow_speed and (host_speed <= 0.0 or then <= low):
                return True
        if host_speed <= 0.0 and fast_speed <= 0.0 and slow_speed <= 0.0:
            return True
    return False


@kernel
def narrowed(share: float, centre: float, bounds: Bounds) -> tuple[float, float]:
    """A share of the range of a driver's accelerations [m/s^2], around what it is expected to do."""
    low = centre - share * (centre + bounds.driver_braking)
    return low, centre + share * (bounds.driver_acceleration - centre)


@kernel
def kept(
    first: float,
    state: FloatArray,
    low: float,
    high: float,
    since: float,
    bounds: Bounds,
) -> bool:
    """Whether an escape is left after one cycle of acceleration `first`; a stop with the way `SHORT` to spare.

    So a host that creeps up to the merging point does not come to stand a rounding error before it.
    """
    for then in (bounds.min_acceleration, bounds.max_acceleration):
        if escapes(first, then, state, low, high, since, SHORT, bounds):
            return True
    return False


@kernel
def constrain(
    state: FloatArray,
    guarded: BoolArray,
    shares: FloatArray,
    centre: FloatArray,
    since: FloatArray,
    levels: int,
    bounds: Bounds,
    wanted: FloatArray,
    status: IntArray,
) -> None:
    """Change accelerations to the nearest ones that leave an escape, where there is an escape.

    The bounds on the driver are narrowed to `shares` of their widths around `centre`, one after the other, until there
    is an escape within them.

    Args:
        state: The rows of an `Observation`, the deviations of the merging car's station and speed, and how much further
            on it may be [m], shape (9, n).
        guarded: Encounters that are looked at, shape (n,).
        shares: Shares of the driver's bounds, falling, shape (grades,).
        centre: What the driver is expected to do [m/s^2], shape (n,).
        since: Time for which the driver has been in the lane [s], shape (n,).
        levels: Number of steps between the wanted acceleration and the escape's that are tried.
        bounds: What the host can do and the merging driver may do.
        wanted: Accelerations [m/s^2], to be changed, shape (n,).
        status: To be filled: `UNSEEN`, `NONE`, `LEFT` or `FORCED`, shape (n,).
    """
    for row in range(state.shape[1]):
        status[row] = UNSEEN
        if not guarded[row]:
            continue
        first = wanted[row]
        for share in shares:
            low, high = narrowed(share, centre[row], bounds)
            status[row] = LEFT
            if kept(first, state[:, row], low, high, since[row], bounds):
                break
            status[row] = NONE
            nearest = np.inf
            for bound in (bounds.min_acceleration, bounds.max_acceleration):
                if not escapes(bound, bound, state[:, row], low, high, since[row], TOL, bounds):
                    continue
                status[row] = FORCED
                for level in range(1, levels + 1):
                    tried = first + (bound - first) * level / levels
                    if level == levels or escapes(tried, bound, state[:, row], low, high, since[row], SHORT, bounds):
                        if abs(tried - first) < nearest:
                            nearest, wanted[row] = abs(tried - first), tried
                        break
            if status[row] == FORCED:
                break


@kernel
def widest(
    state: FloatArray, shares: FloatArray, centre: FloatArray, since: FloatArray, bounds: Bounds, found: FloatArray
) -> None:
    """Fill `found` with the largest share of the driver's bounds within which there is an escape, 0 without one."""
    for row in range(state.shape[1]):
        found[row] = 0.0
        for share in shares:
            low, high = narrowed(share, centre[row], bounds)
            if escapes(
                bounds.min_acceleration, bounds.min_acceleration, state[:, row], low, high, since[row], TOL, bounds
            ) or escapes(
                bounds.max_acceleration, bounds.max_acceleration, state[:, row], low, high, since[row], TOL, bounds
            ):
                found[row] = share
                break

"""Rollouts against a driver beside the host lane, who may come in anywhere up to the end of its own lane."""

from merge_cosim.controllers.compiled.policies import SUDDEN, HostLaw, host_acceleration, time_left
from merge_cosim.core.kernels import kernel
from merge_cosim.core.units import FloatArray
from merge_cosim.estimators.compiled.drivers import NEAR, WAIT, DriverLaw, reacting


@kernel
def kept_gap(speed: float, leader_speed: float, time: float, host: HostLaw) -> float:
    """Gap [m] that a car needs behind another: the time at its speed, and what it stops later at the same braking."""
    faster = max(speed * speed - leader_speed * leader_speed, 0.0)
    return host.d0 + time * speed + faster / (-2.0 * host.min_acceleration)


@kernel
def has_room(
    host_station: float,
    host_speed: float,
    host_length: float,
    station: float,
    speed: float,
    length: float,
    lead: float,
    lead_speed: float,
    host: HostLaw,
) -> bool:
    """Whether a driver beside the lane has room to come in: behind the host, or between it and the car ahead of it.

    `lead` is the station of the rear of the car ahead.
    """
    if host_station >= station:
        return host_station - host_length - station >= kept_gap(speed, host_speed, 0.0, host)
    if lead - station < kept_gap(speed, lead_speed, 0.0, host):
        return False
    return station - length - host_station >= kept_gap(host_speed, speed, host.behind_margin, host)


@kernel
def note_room(state: FloatArray, offered: FloatArray, dt: float, host: HostLaw) -> None:
    """Count the time [s] for which each driver beside the lane has had the room to come in.

    Args:
        state: See `merge_cosim.controllers.compiled.rollouts.choose`.
        offered: The times, to be changed, shape (n,).
        dt: Length of a cycle [s].
        host: Constants of the host.
    """
    for row in range(state.shape[1]):
        h, v, s, u, length_h, length_m = state[:6, row]
        room, lead, lead_speed = state[9:, row]
        if room > 0.0 and has_room(h, v, length_h, s, u, length_m, lead, lead_speed, host):
            offered[row] += dt


@kernel
def rollout_beside(
    policy: int, held: float, state: FloatArray, offered: float, last: float, host: HostLaw, law: DriverLaw
) -> float:
    """Cost of one policy of the host and of the driver's time; this driver looks, so no overlap is counted.

    The driver goes on beside the lane, stops at the end of its own, and comes in once it has had room in this rollout
    for longer than `offered`, the time for which it has had room so far without coming in. The host
    sees it at the merging point until then, and keeps distance to the car ahead, as the driver does when it is in.

    Args:
        policy: The host's policy.
        held: The acceleration of one that holds one [m/s^2].
        state: A column of what `merge_cosim.controllers.compiled.rollouts.choose` takes.
        offered: The time for which the driver has had the room [s].
        last: The host's last command [m/s^2], NaN without one.
        host: Constants of the host and of the costs.
        law: Constants of the drivers.
    """
    host_station, host_speed, station, speed, host_length, length = state[:6]
    room, lead, lead_speed = state[9:]
    limit = law.speed_limit
    end, point = station + room, station
    goal, aim = max(host_station, end) + host.goal, end + host.goal
    reached, came = -1.0, -1.0
    effort, time, since = 0.0, 0.0, 0.0
    beside, acceleration, change = True, last, host.change * host.step
    for _ in range(host.steps):
        if beside:
            if has_room(host_station, host_speed, host_length, station, speed, length, lead, lead_speed, host):
                since += host.step
            beside = since <= offered
            point = station + NEAR if beside else station
        h, s = host_station - point, station - point
        wanted = host_acceleration(policy, held, h, host_speed, s, speed, length, host, limit)
        if policy != SUDDEN and acceleration == acceleration:  # not NaN: there is a command before
            wanted = min(max(wanted, acceleration - change), acceleration + change)
        behind = host.k_gap * (lead - host_station - host.d0 - host.headway * host_speed)
        behind += host.k_speed * (lead_speed - host_speed)
        acceleration = min(wanted, max(behind, host.min_acceleration))
        if beside:
            driver = -speed * speed / (2.0 * max(end - station, NEAR))
            driver = max(driver, law.min_acceleration) if driver <= -host.end_braking else 0.0
        else:
            driver = reacting(WAIT, 0.0, h, host_speed, host_length, s, speed, law)
        before = host_speed
        host_speed = max(host_speed + acceleration * host.step, 0.0)
        speed = min(max(speed + driver * host.step, 0.0), max(limit, speed))
        if before > host_speed:
            effort += (before - host_speed) * (before - host_speed) / host.step
        if reached < 0.0 and host_station + host_speed * host.step >= goal:
            reached = time + (goal - host_station) / host_speed
        if came < 0.0 and station + speed * host.step >= aim:
            came = time + (aim - station) / speed
        host_station += host_speed * host.step
        station += speed * host.step
        lead += lead_speed * host.step
        time += host.step
    if reached < 0.0:
        reached = time + time_left(goal - host_station, host_speed, limit, host)
    if beside:
        came = time + 2.0 * max(end - station, 0.0) / max(speed, 1.0) + time_left(host.goal, 0.0, limit, host)
    elif came < 0.0:
        came = time + time_left(aim - station, speed, limit, host)
    extra = host.sudden if policy == SUDDEN else 0.0
    return host.progress * reached + host.courtesy * came + host.effort * effort + extra

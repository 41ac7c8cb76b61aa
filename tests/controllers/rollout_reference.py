"""The rollouts of `merge_cosim.controllers.compiled` once more, in numpy over all encounters at once."""

import numpy as np

from merge_cosim.controllers.rollout import POLICIES, Rollout
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import time_to_arrival

TOL = 1e-6
SUDDEN = "brake 4", "accelerate 2"
YIELD, NOT_YIELD, IGNORE, WAIT, ACCELERATE, LATE = range(6)


def needed(way, speed, time):
    return np.where(speed * time > 2 * way, -(speed**2) / (2 * way), 2 * (way - speed * time) / time**2)


def driver(kind, trait, host, host_speed, length, station, speed, p, limit, dt=0.1):
    """Acceleration of a driver of type `kind` in every encounter."""
    arrival, way = time_to_arrival(host, host_speed), np.maximum(-station, 0.1)
    if kind in (IGNORE, ACCELERATE):
        plan = trait * (kind == ACCELERATE) + np.zeros_like(station)
    elif kind == LATE:
        plan = np.where(way <= trait, p.driver_max_acceleration, 0.0)
    elif kind == YIELD:
        plan = np.minimum(needed(way, speed, np.maximum(arrival + trait, dt)), 0)
    elif kind == NOT_YIELD:
        plan = np.maximum(needed(way, speed, np.maximum(arrival - trait, dt)), 0)
    else:
        stop = -(speed**2) / (2 * way)
        stop = np.where(stop <= -p.waiting_braking, stop, 0.0)
        early = arrival - time_to_arrival(station, speed) >= p.critical_gap
        plan = np.where(early, p.driver_k_free * (limit - speed), stop)
    lead = host - station
    free = p.driver_k_free * (limit - speed)
    behind = p.driver_k_gap * (lead - length - p.driver_d0 - p.driver_headway * speed)
    behind = np.minimum(free, behind + p.driver_k_speed * (host_speed - speed))
    after = np.where(lead > TOL, behind, free)
    if kind == WAIT:
        beside = (station < -TOL) & (lead > -TOL) & (lead < length + p.driver_d0)
        after = np.where(beside, -(speed**2) / (2 * way), after)
    looks = {IGNORE: np.full_like(station, -np.inf), ACCELERATE: station, LATE: station}
    wanted = np.where(looks.get(kind, np.maximum(host, station)) >= -TOL, after, plan)
    wanted = np.where(free < 0, np.minimum(wanted, free), wanted)
    return np.clip(wanted, p.driver_min_acceleration, p.driver_max_acceleration)


def wanted(policy, host, host_speed, station, speed, length, p, limit):
    """Acceleration that a policy wants in every encounter."""
    free = p.k_free * (limit - host_speed)
    follow = p.k_gap * (station - length - host - p.d0 - p.headway * host_speed) + p.k_speed * (speed - host_speed)
    behind = needed(np.maximum(-host, 0.1), host_speed, time_to_arrival(station, speed) + p.behind_margin)
    held = {"brake 1": -1, "brake 2": -2, "brake 4": -4, "accelerate 1": 1, "accelerate 2": 2}
    plan = {
        "free": free,
        "coast": np.minimum(0, free),
        "follow": np.minimum(follow, free),
        "behind": np.where(host >= -TOL, free, np.minimum(behind, free)),
    }.get(policy)
    if plan is None:
        plan = np.minimum(held[policy], free)
    merged = np.where(station - host >= -TOL, np.minimum(follow, free), free)
    return np.clip(np.where(station >= -TOL, merged, plan), p.min_acceleration, p.max_acceleration)


def cost(policy, kind, trait, delay, seen: Observation, last, p: Rollout, limit):
    """Cost and probability of an overlap, shape (n,) each."""
    host, host_speed, length_h = seen.host_station.copy(), seen.host_speed.copy(), seen.host_length
    station, speed, length_m = seen.merging_station.copy(), seen.merging_speed.copy(), seen.merging_length
    goal = np.maximum(host, 0) + p.goal
    n = len(host)
    surest, effort, reached, acceleration = np.full(n, 1e9), np.zeros(n), np.full(n, -1.0), last.copy()
    both, on, ended = np.full(n, -1), np.ones(n, dtype=bool), np.zeros(n)
    for k in range(p.steps):
        now = k * p.step
        a = wanted(policy, host, host_speed, station, speed, length_m, p, limit)
        if policy not in SUDDEN:
            change = p.max_jerk * p.step
            bounded = np.minimum(np.maximum(a, acceleration - change), acceleration + change)
            a = np.where(np.isnan(acceleration), a, bounded)
        b = driver(kind, trait, host, host_speed, length_h, station, speed, p, limit)
        b = np.where(now >= delay, b, 0.0)
        faster = np.maximum(host_speed + a * p.step, 0)
        quicker = np.minimum(np.maximum(speed + b * p.step, 0), np.maximum(limit, speed))
        effort += np.where(on, np.maximum(host_speed - faster, 0) ** 2 / p.step, 0)
        crosses = on & (reached < 0) & (host + faster * p.step >= goal)
        reached = np.where(crosses, now + (goal - host) / np.where(faster > 0, faster, 1), reached)
        host, station = np.where(on, host + faster * p.step, host), np.where(on, station + quicker * p.step, station)
        host_speed, speed = np.where(on, faster, host_speed), np.where(on, quicker, speed)
        acceleration = np.where(on, a, acceleration)
        ended = np.where(on, now + p.step, ended)
        here = on & (np.minimum(host, station) >= -TOL)
        ratios = [np.where(v > 0, s / np.where(v > 0, v, 1), np.inf) for s, v in ((host, host_speed), (station, speed))]
        back = np.clip(np.minimum(*ratios), 0, p.step)
        back = np.where(both < 0, np.where(host_speed > 0, back, np.minimum(back, 0)), 0.0)
        both += here
        for early in (back, 0.0 * back):
            s_h, s_m = host - early * host_speed, station - early * speed
            gap = np.where(s_m - s_h >= -TOL, s_m - length_m - s_h, s_h - length_h - s_m)
            ratio = gap / (p.spread + p.spread_rate * (ended - early))
            surest = np.where(here, np.minimum(surest, ratio), surest)
        on &= ~(here & ((gap < -TOL) | (both * p.step >= p.scored)))
    pull = np.clip(0.5 * p.k_free * (limit - host_speed), 0.05, p.max_acceleration)
    later = ended + (np.sqrt(np.maximum(host_speed**2 + 2 * pull * (goal - host), 0)) - host_speed) / pull
    reached = np.where(reached < 0, later, reached)
    probability = 1 / (1 + np.exp(np.clip(1.702 * surest, -50, 50)))
    sudden = p.sudden * (policy in SUDDEN)
    return sudden + p.progress * reached + p.effort * effort + p.overlap * probability, probability


def costs(seen, traits, delays, last, planner, limit):
    """All costs, shape (n, policies, types)."""
    return np.stack(
        [
            np.stack([cost(q, k, traits[:, k], delays, seen, last, planner, limit)[0] for k in range(6)], axis=-1)
            for q in POLICIES
        ],
        axis=1,
    )

"""The host's policies driven against each type of driver, step by step, and what each pair costs."""

from math import exp

import numpy as np

from merge_cosim.controllers.compiled.beside import rollout_beside
from merge_cosim.controllers.compiled.policies import SUDDEN, HostLaw, host_acceleration, time_left
from merge_cosim.core.kernels import kernel
from merge_cosim.core.units import BoolArray, FloatArray, IntArray
from merge_cosim.estimators.compiled.drivers import TOL, DriverLaw, reacting

LOGISTIC = 1.702
"""Slope of the logistic function that is closest to the normal distribution."""


@kernel
def least_time(way: float, speed: float, limit: float, host: HostLaw) -> float:
    """A time [s] that is surely not above what a rollout takes for the rest of the way to the goal."""
    if way > 4.0 * limit / host.k_free:  # there the speed after the rollout may be taken to be above the limit
        return 0.0
    return way / (1.1 * max(limit, speed))


@kernel
def rollout(
    policy: int,
    held: float,
    kind: int,
    trait: float,
    delay: float,
    host_station: float,
    host_speed: float,
    host_length: float,
    station: float,
    speed: float,
    length: float,
    spread: float,
    spread_rate: float,
    last: float,
    enough: float,
    host: HostLaw,
    law: DriverLaw,
) -> tuple[float, float]:
    """Cost of one policy against one type of driver, and the probability of an overlap.

    Where the cost is sure to be above `enough`, the rollout stops and gives some cost above it.
    """
    limit = law.speed_limit
    goal = max(host_station, 0.0) + host.goal
    extra = host.sudden if policy == SUDDEN else 0.0
    surest = 1e9
    effort = 0.0
    acceleration = last
    unmoved = reacting(kind, trait, host_station, host_speed, host_length, station, speed, law)
    reached = -1.0
    sure = 0.0
    both = -1
    time = 0.0
    change = host.change * host.step
    for _ in range(host.steps):
        if reached < 0.0:
            sure = time + least_time(goal - host_station, host_speed, limit, host)
        if host.progress * sure + host.effort * effort + extra > enough:
            return np.inf, 0.0
        wanted = host_acceleration(policy, held, host_station, host_speed, station, speed, length, host, limit)
        if policy != SUDDEN and acceleration == acceleration:  # not NaN: there is a command before
            wanted = min(max(wanted, acceleration - change), acceleration + change)
        acceleration = wanted
        driver = 0.0
        if time >= delay and not host.reacts:
            driver = unmoved if station < -TOL else 0.0
        elif time >= delay:
            driver = reacting(kind, trait, host_station, host_speed, host_length, station, speed, law)
        before = host_speed
        host_speed = max(host_speed + acceleration * host.step, 0.0)
        speed = min(max(speed + driver * host.step, 0.0), max(limit, speed))
        if before > host_speed:
            effort += (before - host_speed) * (before - host_speed) / host.step
        if reached < 0.0 and host_station + host_speed * host.step >= goal:
            reached = sure = time + (goal - host_station) / host_speed
        host_station += host_speed * host.step
        station += speed * host.step
        time += host.step
        if min(host_station, station) < -TOL:
            continue
        at, host_at, merging_at = time, host_station, station
        if both < 0:  # the moment within the step at which the second of the two reaches the merging point
            back = 0.0
            if host_speed > 0.0:
                back = host_station / host_speed
            if speed > 0.0:
                back = min(back, station / speed)
            back = min(max(back, 0.0), host.step)
            at, host_at, merging_at = time - back, host_station - back * host_speed, station - back * speed
        both += 1
        for _ in range(2):
            ahead = merging_at - host_at >= -TOL
            gap = merging_at - length - host_at if ahead else host_at - host_length - merging_at
            surest = min(surest, gap / (spread + spread_rate * at))
            at, host_at, merging_at = time, host_station, station
        if gap < -TOL or both * host.step >= host.scored:
            break
    if reached < 0.0:
        reached = time + time_left(goal - host_station, host_speed, limit, host)
    cost = host.progress * reached + host.effort * effort + extra
    probability = 1.0 / (1.0 + exp(min(max(LOGISTIC * surest, -50.0), 50.0)))
    return cost + host.overlap * probability, probability


@kernel
def expected_cost(
    row: int,
    policy: int,
    held: float,
    state: FloatArray,
    belief: FloatArray,
    traits: FloatArray,
    delay: float,
    last: float,
    least: float,
    enough: float,
    host: HostLaw,
    law: DriverLaw,
) -> tuple[float, float]:
    """Cost of a policy expected over the types of drivers, and probability of an overlap; see `rollout`."""
    if state[9, row] > 0.0:
        return rollout_beside(policy, held, state[:, row], delay, last, host, law), 0.0
    h, v, s, u, length_h, length_m = state[:6, row]
    spread, spread_rate = host.spread + state[6, row], host.spread_rate + state[7, row]
    expected, danger, left, likeliest = 0.0, 0.0, 0.0, 0
    for kind in range(belief.shape[1]):
        if belief[row, kind] >= least:
            left += belief[row, kind]
        if belief[row, kind] > belief[row, likeliest]:
            likeliest = kind
    soon = host.progress * least_time(max(h, 0.0) + host.goal - h, v, law.speed_limit, host)
    for number in range(-1, belief.shape[1]):  # the likeliest type first: its cost alone often exceeds the limit
        kind = likeliest if number < 0 else number
        share = belief[row, kind]
        if share < least or number == likeliest:
            continue
        left -= share
        most = (enough - expected - soon * left) / max(share, 1e-300)
        cost, overlaps = rollout(
            policy,
            held,
            kind,
            traits[row, kind],
            delay,
            h,
            v,
            length_h,
            s,
            u,
            length_m,
            spread,
            spread_rate,
            last,
            most,
            host,
            law,
        )
        expected += share * cost
        danger += share * overlaps
        if expected + soon * left > enough:
            return np.inf, 0.0
    return expected, danger


@kernel
def cost_table(
    state: FloatArray,
    belief: FloatArray,
    traits: FloatArray,
    delays: FloatArray,
    kinds: IntArray,
    held: FloatArray,
    last: FloatArray,
    least: float,
    host: HostLaw,
    law: DriverLaw,
    costs: FloatArray,
) -> None:
    """Fill `costs`, shape (n, policies, types), with the cost of every policy against every type; see `choose`."""
    for row in range(state.shape[1]):
        h, v, s, u, length_h, length_m = state[:6, row]
        for policy in range(kinds.shape[0]):
            for kind in range(belief.shape[1]):
                costs[row, policy, kind] = 0.0
                if state[9, row] > 0.0:
                    costs[row, policy, kind] = rollout_beside(
                        kinds[policy], held[policy], state[:, row], delays[row], last[row], host, law
                    )
                elif belief[row, kind] >= least:
                    costs[row, policy, kind], _ = rollout(
                        kinds[policy],
                        held[policy],
                        kind,
                        traits[row, kind],
                        delays[row],
                        h,
                        v,
                        length_h,
                        s,
                        u,
                        length_m,
                        host.spread + state[6, row],
                        host.spread_rate + state[7, row],
                        last[row],
                        np.inf,
                        host,
                        law,
                    )


@kernel
def choose(
    state: FloatArray,
    plans: BoolArray,
    belief: FloatArray,
    traits: FloatArray,
    delays: FloatArray,
    kinds: IntArray,
    held: FloatArray,
    last: FloatArray,
    least: float,
    commitment: float,
    host: HostLaw,
    law: DriverLaw,
    chosen: IntArray,
    risk: FloatArray,
    centre: FloatArray,
    wanted: FloatArray,
) -> None:
    """Choose a policy for each encounter that `plans`, and what it wants now.

    Policies are rolled out only until it is sure that they are not chosen.

    Args:
        state: The rows of an `Observation`, the deviations of the merging car's station and speed, and how much further
            on it may be [m]; how far it can go on beside the lane, 0 where it comes in at the merging point [m], and
            then the station of the rear of the car ahead of the host [m] and its speed [m/s]; shape (12, n).
        plans: Encounters whose merging car is not yet in the lane, shape (n,).
        belief: Belief in each type of driver, shape (n, types); types with less than `least` are left out, at cost 0.
        traits: The driver's trait under each type, see `planned`, shape (n, types).
        delays: Time before the driver acts [s]; beside the lane, for which it has had the room; shape (n,).
        kinds: What each policy is, shape (policies,).
        held: The acceleration of those that hold one [m/s^2], shape (policies,).
        last: The host's last command [m/s^2], NaN without one, shape (n,).
        least: Least belief.
        commitment: How much cheaper a policy must be to replace the chosen one.
        host: Constants of the host and of the costs.
        law: Constants of the drivers.
        chosen: Policy of the cycle before, -1 without one; to be changed, shape (n,).
        risk: Probability of an overlap under the chosen policy; to be filled, shape (n,).
        centre: Acceleration expected of the driver [m/s^2]; to be filled, shape (n,).
        wanted: Acceleration that the chosen policy wants [m/s^2]; to be filled, shape (n,).
    """
    for row in range(state.shape[1]):
        h, v, s, u, length_h, length_m = state[:6, row]
        centre[row] = 0.0
        for kind in range(belief.shape[1]):
            if belief[row, kind] >= least:
                centre[row] += belief[row, kind] * reacting(kind, traits[row, kind], h, v, length_h, s, u, law)
        if not plans[row]:
            continue
        before, enough = chosen[row], np.inf
        if before >= 0:
            cost, risk[row] = expected_cost(
                row,
                kinds[before],
                held[before],
                state,
                belief,
                traits,
                delays[row],
                last[row],
                least,
                np.inf,
                host,
                law,
            )
            enough = cost - commitment
        for policy in range(kinds.shape[0]):
            if policy == before:
                continue
            cost, danger = expected_cost(
                row,
                kinds[policy],
                held[policy],
                state,
                belief,
                traits,
                delays[row],
                last[row],
                least,
                enough,
                host,
                law,
            )
            if cost < enough:
                enough, chosen[row], risk[row] = cost, policy, danger
        policy = chosen[row]
        wanted[row] = host_acceleration(kinds[policy], held[policy], h, v, s, u, length_m, host, law.speed_limit)

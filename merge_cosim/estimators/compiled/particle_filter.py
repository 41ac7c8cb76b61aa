"""The particle filter over state and maneuver, one encounter after the other: no sum depends on the batch.

Arrays are copied by loops: to compile `a[:] = b` takes numba several times as long.
"""

from math import exp, inf
from typing import NamedTuple

import numpy as np

from merge_cosim.core.kernels import kernel
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.compiled.normal import normals, uniform

YIELD, NOT_YIELD, MANEUVERS = 0, 1, 3


class ActionLaw(NamedTuple):
    """Constants of the action model, see `merge_cosim.estimators.dbn_pf.DbnPf`."""

    desired_speed: float
    min_arrival: float
    pad: float
    k_free: float
    min_acceleration: float
    max_acceleration: float


class Particles(NamedTuple):
    """Particles of n encounters, shape (n, M) each, see `merge_cosim.estimators.particles.Cloud`."""

    station: FloatArray
    speed: FloatArray
    maneuver: IntArray


class Scene(NamedTuple):
    """What the filter knows of n encounters, shape (n,) each.

    `arrival` is the host's time to arrival where the interval began [s]; lengths in m; station and speed of the merging
    car as observed at its end [m, m/s].
    """

    arrival: FloatArray
    host_length: FloatArray
    merging_length: FloatArray
    station: FloatArray
    speed: FloatArray


class FilterLaw(NamedTuple):
    """Constants of the filter: `tau` and `half` of its steps [s], `change` of maneuver per step, `new` particles."""

    tau: float
    half: float
    change: float
    acceleration_noise: float
    sigma_station: float
    sigma_speed: float
    new: int


@kernel
def mean_acceleration(
    maneuver: IntArray,
    station: FloatArray,
    speed: FloatArray,
    arrival: float,
    host_length: float,
    merging_length: float,
    law: ActionLaw,
    mean: FloatArray,
) -> None:
    """Fill in the acceleration of the M particles of one encounter without noise, `mean` [m/s^2]."""
    time = max(arrival, law.min_arrival)
    per_square = 2.0 / time**2
    behind, ahead = -(host_length + law.pad), merging_length + law.pad
    for i in range(len(mean)):
        free = min(max(law.k_free * (law.desired_speed - speed[i]), law.min_acceleration), law.max_acceleration)
        yields = (behind - station[i] - speed[i] * time) * per_square
        beats = (ahead - station[i] - speed[i] * time) * per_square
        wanted = min(free, yields) if maneuver[i] == YIELD else max(free, beats) if maneuver[i] == NOT_YIELD else free
        mean[i] = min(max(wanted, law.min_acceleration), law.max_acceleration)


@kernel
def mean_accelerations(
    maneuver: IntArray,
    station: FloatArray,
    speed: FloatArray,
    arrival: FloatArray,
    host_length: FloatArray,
    merging_length: FloatArray,
    law: ActionLaw,
) -> FloatArray:
    """The same of n encounters with M particles each, shapes (n, M) and (n,); returns shape (n, M)."""
    mean = np.empty(station.shape)
    for n in range(len(mean)):
        mean_acceleration(
            maneuver[n], station[n], speed[n], arrival[n], host_length[n], merging_length[n], law, mean[n]
        )
    return mean


@kernel
def step(
    cloud: Particles,
    rows: IntArray,
    scene: Scene,
    keys: Keys,
    drawn: IntArray,
    law: ActionLaw,
    filter_law: FilterLaw,
    between: Particles,
    weights: FloatArray,
    belief: FloatArray,
) -> None:
    """One update of n encounters: particles move, are weighted, resampled, and in part drawn anew.

    Args:
        cloud: The particles of all encounters; those of the n go on in place.
        rows: Which encounters, shape (n,).
        scene: What is known of them.
        keys: Their random streams, shape (n,).
        drawn: Numbers drawn from each so far, shape (n,); goes on.
        law: Constants of the action model.
        filter_law: Constants of the filter.
        between: Filled with the moved particles of each encounter or, where it has a single row, of the last one.
        weights: Filled with their weights, which sum to 1; as many rows.
        belief: Filled with the shares of the maneuvers, shape (3, n).
    """
    particles = weights.shape[1]
    scratch, chosen = np.empty(2 * particles), np.empty(particles, dtype=np.int64)
    for n in range(len(rows)):
        row, held = rows[n], n if len(weights) > 1 else 0
        station, speed, maneuver = cloud.station[row], cloud.speed[row], cloud.maneuver[row]
        further, faster, now = between.station[held], between.speed[held], between.maneuver[held]
        place, key = np.uint64(drawn[n]), keys[n]
        for i in range(particles):
            now[i] = maneuver[i]
        if filter_law.change > 0:
            change(now, key, place, filter_law.change)
            place += np.uint64(particles)
        mean, noise = scratch[:particles], scratch[particles:]
        normals(key, place, noise)
        place += np.uint64(particles)
        mean_acceleration(
            now, station, speed, scene.arrival[n], scene.host_length[n], scene.merging_length[n], law, mean
        )
        tau, half = filter_law.tau, filter_law.half
        for i in range(particles):
            acceleration = mean[i] + filter_law.acceleration_noise * noise[i]
            faster[i] = max(speed[i] + acceleration * tau, 0.0)
            further[i] = station[i] + speed[i] * (tau - half) + faster[i] * half
        weigh(further, faster, scene.station[n], scene.speed[n], filter_law, weights[held])
        shares = np.zeros(MANEUVERS)
        for i in range(particles):
            shares[now[i]] += weights[held, i]
        for i in range(MANEUVERS):
            belief[i, n] = shares[i]
        kept = particles - filter_law.new
        choose(weights[held], uniform(key, place), kept, chosen)
        place += np.uint64(1)
        for j in range(kept):
            particle = chosen[j]
            station[j], speed[j], maneuver[j] = further[particle], faster[particle], now[particle]
        noise = scratch[: 2 * filter_law.new]
        normals(key, place, noise)
        place += np.uint64(2 * filter_law.new)
        for j in range(filter_law.new):
            station[kept + j] = scene.station[n] + filter_law.sigma_station * noise[j]
            speed[kept + j] = max(scene.speed[n] + filter_law.sigma_speed * noise[filter_law.new + j], 0.0)
        choose(shares, uniform(key, place), filter_law.new, chosen)
        for j in range(filter_law.new):
            maneuver[kept + j] = chosen[j]
        drawn[n] = place + np.uint64(1)


@kernel
def change(maneuver: IntArray, key: np.uint64, place: np.uint64, chance: float) -> None:
    """Let each maneuver change with a probability, to either other one alike; numbers of a stream from `place` on."""
    for i in range(len(maneuver)):
        # of the numbers below the probability, one half changes to the next maneuver and one to that after it
        drawn = uniform(key, place + np.uint64(i)) * (2.0 / chance)
        if drawn < 2.0:
            maneuver[i] = (maneuver[i] + (2 if drawn < 1.0 else 1)) % MANEUVERS


@kernel
def weigh(
    station: FloatArray, speed: FloatArray, seen_station: float, seen_speed: float, law: FilterLaw, weights: FloatArray
) -> None:
    """Fill in the weights of the particles of one encounter, which sum to 1; shape (M,)."""
    least = inf
    for i in range(len(weights)):
        away = (seen_station - station[i]) * (1.0 / law.sigma_station)
        off = (seen_speed - speed[i]) * (1.0 / law.sigma_speed)
        weights[i] = away * away + off * off
        least = min(least, weights[i])
    total = 0.0
    for i in range(len(weights)):
        weights[i] = exp(-0.5 * (weights[i] - least))
        total += weights[i]
    for i in range(len(weights)):
        weights[i] /= total


@kernel
def choose(weights: FloatArray, start: float, count: int, chosen: IntArray) -> None:
    """Low-variance resampling of one row, see `merge_cosim.estimators.particles.low_variance`."""
    total = 0.0
    for i in range(len(weights)):
        total += weights[i]
    scale, particle, last = count / total, 0, len(weights) - 1
    cumulative = weights[0]
    for j in range(count):
        while particle < last and j >= cumulative * scale - start:
            particle += 1
            cumulative += weights[particle]
        chosen[j] = particle

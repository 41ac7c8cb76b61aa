"""The filter over driver types, one encounter after the other."""

from math import exp, log, pi, sqrt
from typing import NamedTuple

import numpy as np

from merge_cosim.core.kernels import kernel
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.compiled.drivers import ACCELERATE, IGNORE, LATE, NOT_YIELD, DriverLaw, arrival, reacting


class FilterLaw(NamedTuple):
    """Constants of the filter, see `merge_cosim.estimators.interactive.Interactive`."""

    keep: float
    sigma: float
    innovation: float
    rougher: float
    outlier: float
    reacts: float
    changes: float


@kernel
def update(
    host_station: FloatArray,
    host_speed: FloatArray,
    station: FloatArray,
    speed: FloatArray,
    host_length: FloatArray,
    kinds: IntArray,
    traits: FloatArray,
    prior: FloatArray,
    law: DriverLaw,
    filter_law: FilterLaw,
    weight: FloatArray,
    expected: FloatArray,
    off: FloatArray,
    roughness: FloatArray,
    acceleration: FloatArray,
    deviation: FloatArray,
    age: IntArray,
    beliefs: FloatArray,
    mean_traits: FloatArray,
    unreacted: FloatArray,
    evidence_sum: FloatArray,
    log_odds: FloatArray,
) -> None:
    """One cycle of all encounters; see `Interactive`."""
    hypotheses, levels = kinds.shape[0], roughness.shape[1]
    evidence = np.zeros(levels)
    for row in range(station.shape[0]):
        if age[row] > 0:
            variance = deviation[row] * deviation[row]
            innovation = filter_law.innovation
            if variance > 0.0:
                innovation = sqrt(innovation**2 + variance * (1.0 - filter_law.keep**2))
            # what changes between the cycles
            for one in range(hypotheses):
                moved = weight[row, 0, one] * filter_law.reacts
                weight[row, 0, one] -= moved
                weight[row, 1, one] += moved
            for acts in range(2):
                total = 0.0
                for one in range(hypotheses):
                    total += weight[row, acts, one]
                for one in range(hypotheses):
                    weight[row, acts, one] += filter_law.changes * (prior[one] * total - weight[row, acts, one])
            mixed = 0.0
            for level in range(levels):
                evidence[level] = 0.0
                mixed += roughness[row, level]
            for level in range(levels):
                roughness[row, level] = 0.99 * roughness[row, level] / mixed + 0.01 / levels
            total = 0.0
            for acts in range(2):
                for one in range(hypotheses):
                    mean = expected[row, one] if acts == 1 else 0.0
                    n = acceleration[row] - mean
                    if age[row] == 1:
                        e, s = n, sqrt(filter_law.sigma**2 + variance + innovation**2)
                    else:
                        e, s = n - filter_law.keep * off[row, acts, one], innovation
                    off[row, acts, one] = n
                    p = 0.0
                    for level in range(levels):
                        density = (1.0 - filter_law.outlier) * exp(-0.5 * e * e / (s * s)) / (s * sqrt(2.0 * pi))
                        density += filter_law.outlier * 0.1
                        evidence[level] += weight[row, acts, one] * density
                        p += roughness[row, level] * density
                        s *= filter_law.rougher
                    weight[row, acts, one] *= p
                    total += weight[row, acts, one]
            for level in range(levels):
                roughness[row, level] *= evidence[level] / total
            if max(host_station[row], station[row]) < 0.0:
                evidence_sum[row] += log(total)
            for acts in range(2):
                for one in range(hypotheses):
                    weight[row, acts, one] /= total
        for kind in range(beliefs.shape[1]):
            beliefs[row, kind] = 0.0
            mean_traits[row, kind] = 0.0
        unreacted[row] = 0.0
        for one in range(hypotheses):
            both = weight[row, 0, one] + weight[row, 1, one]
            beliefs[row, kinds[one]] += both
            mean_traits[row, kinds[one]] += both * traits[one]
            unreacted[row] += weight[row, 0, one]
            planned = reacting(
                kinds[one],
                traits[one],
                host_station[row],
                host_speed[row],
                host_length[row],
                station[row],
                speed[row],
                law,
            )
            planned = min(planned, max((law.speed_limit - speed[row]) / law.dt, 0.0))
            expected[row, one] = max(planned, min(-speed[row] / law.dt, 0.0))
        for kind in range(beliefs.shape[1]):
            mean_traits[row, kind] /= max(beliefs[row, kind], 1e-300)
        age[row] += 1
        host_arrival = arrival(host_station[row], host_speed[row])
        not_yield = beliefs[row, NOT_YIELD]
        if arrival(station[row], speed[row]) < host_arrival:
            not_yield += beliefs[row, IGNORE] + beliefs[row, LATE]
        pull = mean_traits[row, ACCELERATE]
        if max(-station[row], 0.0) < host_arrival * (speed[row] + 0.5 * pull * host_arrival):
            not_yield += beliefs[row, ACCELERATE]
        not_yield = min(max(not_yield, 1e-6), 1.0 - 1e-6)
        log_odds[row] = log(not_yield / (1.0 - not_yield))

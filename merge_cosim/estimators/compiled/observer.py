"""An observer of the merging car: finds out from what a sensor reports how wrong it is, and smooths by as much."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from merge_cosim.core.kernels import kernel
from merge_cosim.core.units import FloatArray, IntArray

CYCLES, LAST_STATION, LAST_SPEED, LAST_RESIDUAL, LAST_CHANGE, RESIDUALS, JUMPS, BENDS, COUNTED, RUNS = range(10)
"""What is remembered of the reports: sums of squares of the residuals, of what they change by from cycle to cycle, and
of what the speed's change changes by; how many of these changes; whether the Kalman filter runs."""
MEAN, COVARIANCE = 10, 13
"""The Kalman filter's station, speed and acceleration, and the upper triangle of their covariance, by rows."""
MEMORY = 19
WHITE, STAYS = 1.0, 0.5
"""Sum of squares of the residual's changes, over that of the residuals, above which noise is found, and is still there.
It tends to 2 for white noise in the speed, to 3 in the station, and is below 0.1 for a speed that was smoothed."""
FARTHEST = 30.0
"""Residual [m] that is no error but another car."""
BEFORE = 1.0
"""Way [m] before the merging point up to which reports tell of noise: living traffic moves the point from there on."""
MOST = 4.0
"""Hardest acceleration or braking [m/s^2] that is taken to have gone on since an old report."""
LEAST = 0.01
"""Least standard deviation of the noise of a sensor that has any [m, m/s]."""


class ObserverLaw(NamedTuple):
    """Constants of the observer, see `merge_cosim.estimators.interactive.Interactive`."""

    exact: float
    change: float
    latency: float
    compensated: bool
    unknown: float
    dt: float


@kernel
def noise(memory: FloatArray, dt: float) -> tuple[float, float]:
    """Variances of the noise in station [m^2] and speed [m^2/s^2] as the reports of an encounter tell them.

    For white noise `w` in the station and `e` in the speed the residual `x_t - x_{t-1} - dt v_t` is `w_t - w_{t-1} -
    dt e_t`, of variance `2 var(w) + dt^2 var(e)`, and the speed's second difference has `6 var(e)`.
    """
    speed = memory[BENDS] / (6.0 * memory[COUNTED])
    station = 0.5 * (memory[RESIDUALS] / (memory[COUNTED] + 1.0) - dt * dt * speed)
    return max(station, LEAST * LEAST), max(speed, LEAST * LEAST)


@kernel
def correct(memory: FloatArray, part: int, report: float, variance: float) -> None:
    """Take in a report of the station (`part` 0) or the speed (1) with noise of a variance."""
    p = memory[COVARIANCE:]
    if part == 0:
        a, b, c = p[0], p[1], p[2]
    else:
        a, b, c = p[1], p[3], p[4]
    own = a if part == 0 else b
    scale = 1.0 / (own + variance)
    off = (report - memory[MEAN + part]) * scale
    memory[MEAN] += a * off
    memory[MEAN + 1] += b * off
    memory[MEAN + 2] += c * off
    p[0] -= a * a * scale
    p[1] -= a * b * scale
    p[2] -= a * c * scale
    p[3] -= b * b * scale
    p[4] -= b * c * scale
    p[5] -= c * c * scale


@kernel
def predict(memory: FloatArray, change: float, dt: float) -> None:
    """A cycle on: the acceleration changes by noise of the standard deviation `change`, then speed and station."""
    p = memory[COVARIANCE:]
    xx, xv, xa, vv, va, aa = p[0], p[1], p[2], p[3], p[4], p[5] + change * change
    vv, va = vv + 2.0 * dt * va + dt * dt * aa, va + dt * aa
    xv = xv + dt * xa  # with the new speed, v' = v + dt a
    xx, xv, xa = xx + 2.0 * dt * xv + dt * dt * vv, xv + dt * vv, xa + dt * va
    p[0], p[1], p[2], p[3], p[4], p[5] = xx, xv, xa, vv, va, aa
    memory[MEAN + 1] += dt * memory[MEAN + 2]
    memory[MEAN] += dt * memory[MEAN + 1]


@kernel
def observe(
    station: FloatArray,
    speed: FloatArray,
    law: ObserverLaw,
    memory: FloatArray,
    seen_station: FloatArray,
    seen_speed: FloatArray,
    acceleration: FloatArray,
    deviation: FloatArray,
    late: FloatArray,
    age: IntArray,
) -> None:
    """One cycle of all encounters; without noise the state is what was reported, bit for bit.

    Args:
        station: Reported stations [m], shape (n,).
        speed: Reported speeds [m/s], shape (n,).
        law: Constants.
        memory: What is remembered of each encounter, zeros at its start, shape (n, `MEMORY`).
        seen_station: To be filled with the state's station [m], shape (n,).
        seen_speed: To be filled with its speed [m/s], shape (n,).
        acceleration: To be filled with its acceleration [m/s^2], NaN in the first cycle, shape (n,).
        deviation: To be filled with the standard deviations of the three, shape (3, n).
        late: To be filled with the way [m] that the car may be further on, for reports may be old, shape (n,).
        age: Set to 0 where noise is found: what was concluded from accelerations before means nothing; shape (n,).
    """
    dt = law.dt
    for row in range(station.shape[0]):
        own = memory[row]
        x, v = station[row], speed[row]
        if law.compensated:
            x -= law.latency * v
        seen_station[row], seen_speed[row] = x, v
        acceleration[row] = np.nan
        late[row] = 0.0
        for part in range(3):
            deviation[part, row] = 0.0
        if own[CYCLES] > 0:
            acceleration[row] = (v - own[LAST_SPEED]) / dt
            residual = x - own[LAST_STATION] - dt * v
            change = v - own[LAST_SPEED]
            if abs(residual) > FARTHEST:
                own[CYCLES] = 0.0
                own[COUNTED] = own[RESIDUALS] = own[JUMPS] = own[BENDS] = own[RUNS] = 0.0
            elif x < -BEFORE:
                own[RESIDUALS] += residual * residual
                if own[CYCLES] > 1.0:
                    own[JUMPS] += (residual - own[LAST_RESIDUAL]) ** 2
                    own[BENDS] += (change - own[LAST_CHANGE]) ** 2
                    own[COUNTED] += 1.0
            own[LAST_RESIDUAL], own[LAST_CHANGE] = residual, change
        own[LAST_STATION], own[LAST_SPEED] = x, v
        own[CYCLES] += 1.0
        white = STAYS if own[RUNS] > 0.0 else WHITE
        if own[JUMPS] <= max(white * own[RESIDUALS], law.exact * law.exact * own[COUNTED]):
            own[RUNS] = 0.0
        else:
            station_noise, speed_noise = noise(own, dt)
            if own[RUNS] == 0.0:
                own[RUNS] = 1.0
                age[row] = 0
                own[MEAN], own[MEAN + 1], own[MEAN + 2] = x, v, 0.0
                for part in range(6):
                    own[COVARIANCE + part] = 0.0
                own[COVARIANCE], own[COVARIANCE + 3], own[COVARIANCE + 5] = 4.0 * station_noise, 4.0 * speed_noise, 1.0
            else:
                predict(own, law.change, dt)
                correct(own, 0, x, station_noise)
                correct(own, 1, v, speed_noise)
                own[MEAN + 1] = max(own[MEAN + 1], 0.0)
            seen_station[row], seen_speed[row], acceleration[row] = own[MEAN], own[MEAN + 1], own[MEAN + 2]
            deviation[0, row] = sqrt(max(own[COVARIANCE], 0.0))
            deviation[1, row] = sqrt(max(own[COVARIANCE + 3], 0.0))
            deviation[2, row] = sqrt(max(own[COVARIANCE + 5], 0.0))
            late[row] = law.unknown * seen_speed[row]
        if law.latency > 0.0:  # the same acceleration ever since
            v = seen_speed[row]
            gained = 0.0 if np.isnan(acceleration[row]) else law.latency * min(max(acceleration[row], -MOST), MOST)
            seen_speed[row] = max(v + gained, 0.0)
            seen_station[row] += 0.5 * law.latency * (v + seen_speed[row])
            deviation[0, row] += law.latency * deviation[1, row]

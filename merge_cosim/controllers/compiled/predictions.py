"""iPCB's predictions: how near each candidate acceleration brings the two cars, and how much speed it costs."""

import numpy as np

from merge_cosim.core.kernels import kernel
from merge_cosim.core.units import TOLERANCE, FloatArray

TOL = TOLERANCE


@kernel
def predict(
    state: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
    gains: FloatArray,
    changes: FloatArray,
    steps: int,
    step: float,
    limit: float,
) -> tuple[FloatArray, FloatArray]:
    """The smallest gap and the lost speed, step by step in the order of numpy's sums, so that no bit differs.

    Args:
        state: The arrays of an `Observation` in its order, shape (n,) each.
        gains: Change of the merging car's speed in a step by intention [m/s], shape (2, n).
        changes: Change of the host's speed in a step by candidate [m/s], shape (candidates,).
        steps: Number of steps.
        step: Their length [s].
        limit: Speed limit [m/s].

    Returns:
        Smallest gap over the steps at which both cars are past the merging point [m], inf without one, shape
        (2, candidates, n); and the mean share of the limit that is lost, shape (candidates, n).
    """
    host_station, host_speed, merging_station, merging_speed, host_length, merging_length = state
    n, candidates = len(host_station), len(changes)
    gap, slow = np.full((2, candidates, n), np.inf), np.empty((candidates, n))
    merging = np.empty((2, steps))
    for row in range(n):
        offset = 0.5 * (host_length[row] - merging_length[row])
        lengths = 0.5 * (host_length[row] + merging_length[row])
        for intention in range(2):
            _merging_stations(
                merging_station[row], merging_speed[row], gains[intention, row], step, limit, merging[intention]
            )
        for candidate in range(candidates):
            way = 0.0
            nearest_0 = nearest_1 = np.inf
            for count in range(steps):
                way += min(max((count + 1.0) * changes[candidate] + host_speed[row], 0.0), limit)
                station = way * step + host_station[row]
                if station >= -TOL:
                    if merging[0, count] >= -TOL:
                        nearest_0 = min(nearest_0, abs(merging[0, count] + offset - station))
                    if merging[1, count] >= -TOL:
                        nearest_1 = min(nearest_1, abs(merging[1, count] + offset - station))
            gap[0, candidate, row], gap[1, candidate, row] = nearest_0 - lengths, nearest_1 - lengths
            slow[candidate, row] = 1.0 - way * (1.0 / (steps * limit))
    return gap, slow


@kernel
def _merging_stations(start: float, speed: float, gain: float, step: float, limit: float, stations: FloatArray) -> None:
    """Stations [m] of a merging car that changes its speed in the steps that begin before the merging point."""
    steps, before = len(stations), 0
    if start < -TOL:
        before, way = 1, 0.0
        for count in range(steps - 1):
            way += min(max(speed + (count + 1.0) * gain, 0.0), limit)
            if start + step * way < -TOL:
                before += 1
    way = 0.0
    for count in range(steps):
        way += min(max(speed + min(count + 1.0, float(before)) * gain, 0.0), limit)
        stations[count] = start + step * way

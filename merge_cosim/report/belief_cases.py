"""Designed approaches that the pages of the methods use to show an estimator's belief."""

from __future__ import annotations

import numpy as np

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import DT, FloatArray

DURATION = 12.0
"""Length of the two approaches of the DBN-PF blog post [s]."""
HOST_START, HOST_SPEED = -200.0, 16.0
MERGING_START, MERGING_SPEED = -208.0, 15.5
PULLS_FROM, PULLS_WITH = 5.0, 1.0
"""When the second driver begins to accelerate [s], and how hard [m/s^2]."""
LENGTH = 5.0


def stays_behind() -> list[Observation]:
    """A driver that is behind the host and stays there, cycle by cycle for 12 s (DBN-PF blog post, first example)."""
    return _approach(np.zeros(round(DURATION / DT)))


def pulls_ahead() -> list[Observation]:
    """A driver that is behind but accelerates from 5 s on and ends ahead (DBN-PF blog post, second example)."""
    time = np.arange(round(DURATION / DT)) * DT
    return _approach(np.where(time >= PULLS_FROM - DT / 2, PULLS_WITH, 0.0))


def behind_but_accelerating(
    host: tuple[float, float], merging: tuple[float, float], acceleration: float, cycles: int
) -> list[Observation]:
    """A merging car behind the host that accelerates evenly (Dong, Dolan, Litkouhi 2017, Fig. 3).

    Args:
        host: Station [m] and speed [m/s] of the host, which keeps its speed, in the last cycle.
        merging: Station and speed of the merging car in the last cycle.
        acceleration: Its acceleration [m/s^2].
        cycles: How many cycles are seen.
    """
    back = np.arange(cycles - 1, -1, -1, dtype=np.float64) * DT
    speed = merging[1] - acceleration * back
    # Euler as the world: the way from a cycle to the last is the sum of the later speeds
    way = np.concatenate([np.cumsum(speed[:0:-1])[::-1] * DT, [0.0]])
    return _sequence(host[0] - host[1] * back, np.full(cycles, host[1]), merging[0] - way, speed)


def _approach(acceleration: FloatArray) -> list[Observation]:
    cycles = len(acceleration) + 1
    speed = MERGING_SPEED + np.concatenate([[0.0], np.cumsum(acceleration * DT)])
    station = MERGING_START + np.concatenate([[0.0], np.cumsum(speed[1:] * DT)])
    host = HOST_START + HOST_SPEED * DT * np.arange(cycles, dtype=np.float64)
    return _sequence(host, np.full(cycles, HOST_SPEED), station, speed)


def _sequence(
    host_station: FloatArray, host_speed: FloatArray, station: FloatArray, speed: FloatArray
) -> list[Observation]:
    length = np.array([LENGTH])
    return [
        Observation(
            host_station=host_station[t : t + 1],
            host_speed=host_speed[t : t + 1],
            merging_station=station[t : t + 1],
            merging_speed=speed[t : t + 1],
            host_length=length,
            merging_length=length,
        )
        for t in range(len(speed))
    ]

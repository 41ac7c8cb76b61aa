"""The earliest pass of a host behind a logged merging car: a dynamic programme over time, speed and station.

The host must stay below station 0 until it arrives, and from then on, for the scored horizon, behind the merging car's
rear bumper. For a given cycle of arrival these conditions are convex in the accelerations, so that at each cycle and
speed the reachable stations are an interval, of which only the two ends are kept. Within the horizon
a station counts only if full braking from it stays behind to the horizon's end. Speeds lie on a grid, with
accelerations that lead from one of its points to another: every path found can be driven, and none is found too soon.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.units import DT, TOLERANCE, FloatArray
from merge_cosim.scoring.rules import Rules

SPEED_STEP = 0.05
"""Resolution of the speed grid [m/s]: accelerations are multiples of 0.5 m/s^2."""


@dataclass(frozen=True)
class Ahead:
    """A logged merging car, for a host behind it.

    Attributes:
        rear: Station of its rear bumper in each cycle [m]; inf once scoring is over.
        arrival: Cycle in which its front reaches the merging point.
        horizon: Cycles that are scored from the later arrival on.
        cycles: Longest run in cycles.
    """

    rear: FloatArray
    arrival: int
    horizon: int
    cycles: int

    @classmethod
    def of(cls, encounters: Encounters, row: int, rules: Rules) -> Ahead:
        """Take the log of one encounter; after its end the merging car keeps its last speed."""
        assert encounters.log is not None
        logged = encounters.log.merging_station[row]
        cycles, horizon = rules.time_out_cycles, rules.horizon_cycles
        beyond = np.arange(1, max(cycles + horizon + 1 - len(logged), 0) + 1)
        station = np.concatenate([logged, logged[-1] + beyond * max(logged[-1] - logged[-2], 0.0)])
        rear = station - float(encounters.merging_length[row])
        rear[min(int(encounters.log.score_until[row]) + 1, len(rear)) :] = np.inf
        past = np.flatnonzero(station >= -TOLERANCE)
        return cls(rear, int(past[0]) if len(past) else len(station), horizon, cycles)


@dataclass(frozen=True)
class Reach:
    """Bounds of a host's driving.

    Attributes:
        speed_limit: It never accelerates beyond this [m/s].
        min_acceleration, max_acceleration: Bounds [m/s^2].
        speed_step: Resolution of the speed grid [m/s].
    """

    speed_limit: float
    min_acceleration: float = -4.0
    max_acceleration: float = 2.0
    speed_step: float = SPEED_STEP

    def speeds(self, speed: float) -> FloatArray:
        """The grid of speeds that can follow an initial one."""
        below = int(speed / self.speed_step + 1e-9)
        above = max(int((self.speed_limit - speed) / self.speed_step + 1e-9), 0)
        return np.maximum(speed + np.arange(-below, above + 1) * self.speed_step, 0.0)

    @property
    def steps(self) -> tuple[int, int]:
        """Most grid points down and up in one cycle."""
        down, up = -self.min_acceleration * DT / self.speed_step, self.max_acceleration * DT / self.speed_step
        return int(down + 1e-9), int(up + 1e-9)


def earliest_pass_behind(ahead: Ahead, station: float, speed: float, goal: float, reach: Reach) -> float:
    """Time [s] of the first cycle in which a host can be at or past `goal` without a failure; inf if never in time.

    Args:
        ahead: The merging car.
        station: The host's initial station [m], upstream of the merging point.
        speed: Its initial speed [m/s].
        goal: Station to reach [m], positive.
        reach: The host's bounds.
    """
    speeds, horizon = reach.speeds(speed), ahead.horizon
    braking = _braking_ways(speeds, horizon, reach.min_acceleration)
    before_braking = np.empty((horizon + 1, len(speeds)))
    # row 0: not yet arrived; row 1 + k: k cycles after the arrival; last row: the horizon is over
    low = np.full((horizon + 3, len(speeds)), np.inf)
    high = np.full((horizon + 3, len(speeds)), -np.inf)
    start = int(np.argmin(np.abs(speeds - speed)))
    low[0, start] = high[0, start] = station
    for cycle in range(1, ahead.cycles + 1):
        low, high = _step(low, speeds, reach, np.minimum, np.inf), _step(high, speeds, reach, np.maximum, -np.inf)
        over = np.maximum(high[-1], high[-2])
        low[2:-1], high[2:-1] = low[1:-2].copy(), high[1:-2].copy()
        low[-1], high[-1] = -np.inf, over
        arrives = cycle >= ahead.arrival
        low[1] = np.maximum(low[0], -TOLERANCE) if arrives else np.inf
        high[1] = high[0] if arrives else -np.inf
        high[0] = np.minimum(high[0], -TOLERANCE)
        rear = ahead.rear[cycle : cycle + horizon + 1, None]
        np.minimum.accumulate(rear - braking[: len(rear)], axis=0, out=before_braking[: len(rear)])
        high[1:-1] = np.minimum(high[1:-1], before_braking[::-1])
        empty = low > high
        low[empty], high[empty] = np.inf, -np.inf
        if high[1:].max() >= goal:
            return cycle * DT
        if np.isneginf(high).all():
            break
    return float("inf")


def _step(ends: FloatArray, speeds: FloatArray, reach: Reach, better: np.ufunc, nothing: float) -> FloatArray:
    """Carry ends of intervals, one row per phase and one column per speed, over one cycle."""
    down, up = reach.steps
    padded = np.pad(ends, ((0, 0), (up, down)), constant_values=nothing)
    best = padded[:, : ends.shape[1]].copy()
    for shift in range(1, up + down + 1):
        better(best, padded[:, shift : shift + ends.shape[1]], out=best)
    best += speeds * DT
    return best


def _braking_ways(speeds: FloatArray, cycles: int, acceleration: float) -> FloatArray:
    """Way [m] under full braking in 0 to `cycles` cycles, shape (cycles + 1, speeds)."""
    later = np.maximum(speeds + np.arange(1, cycles + 1)[:, None] * acceleration * DT, 0.0)
    return np.concatenate([np.zeros((1, len(speeds))), np.cumsum(later * DT, axis=0)])

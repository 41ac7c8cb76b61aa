"""Which logged cars would drive through a car that is no longer where its log has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from merge_cosim.core.units import DT, TOLERANCE, BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Places:
    """Where cars are; every array has shape (n,).

    Attributes:
        lane: NGSIM's lane number.
        x: Front bumper [m past the gore].
        length: Length [m].
        speed: Speed [m/s].
    """

    lane: IntArray
    x: FloatArray
    length: FloatArray
    speed: FloatArray

    def __len__(self) -> int:
        return len(self.x)


def in_conflict(cars: Places, others: Places, min_gap: float, decel: float) -> BoolArray:
    """Which cars overlap which others in their lane, or follow them too closely to brake for them.

    Too closely is a gap of less than `min_gap` + v dt + (v^2 - u^2) / (2 decel), where u is the speed of the car ahead
    and the last term counts if the one behind is faster.

    Args:
        cars: n cars.
        others: m cars.
        min_gap: Gap that is left at standstill [m].
        decel: How hard the car behind brakes [m/s^2].

    Returns:
        Shape (n, m).
    """
    ahead = others.x[None, :] - cars.x[:, None]
    gap = ahead - others.length[None, :]
    faster = np.maximum(cars.speed[:, None] ** 2 - others.speed[None, :] ** 2, 0.0)
    needed = min_gap + cars.speed[:, None] * DT + faster / (2.0 * decel)
    follows = (ahead >= 0.0) & (gap < needed)
    overlaps = (ahead < 0.0) & (-ahead < cars.length[:, None] - TOLERANCE)
    return (cars.lane[:, None] == others.lane[None, :]) & (follows | overlaps)


def near(logged: Places, lane: int, x: float, ahead: float, behind: float) -> BoolArray:
    """Which logged cars are at most `ahead` or `behind` [m] of a place, front to front, in its lane or beside it."""
    offset = logged.x - x
    return (np.abs(logged.lane - lane) <= 1) & (-behind <= offset) & (offset <= ahead)

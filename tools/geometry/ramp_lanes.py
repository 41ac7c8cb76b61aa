"""On-ramp and off-ramp: drawn lines pieced together, and their lateral correction by trajectories."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from geometry.frame import Frame
from geometry.lines import Line
from merge_cosim.core.units import FloatArray

BLEND = 20.0
"""A drawn line is led onto the axis of the auxiliary lane over this length before the node [m]."""
TURN = 8.0
"""Ramps turn so tightly that only so much of them is averaged and gives the direction beyond their ends [m]."""
FADE = 40.0
"""Beyond the trajectories a correction fades out over this length [m]."""


@dataclass(frozen=True)
class Correction:
    """How far right of a drawn line cars drive: 0 at the node, a parabola up to where cars were seen, then fading out.

    Attributes:
        node: x of the node where the lane meets the auxiliary lane [m past the gore].
        sign: -1 for an on-ramp, which lies before its node, 1 for an off-ramp.
        seen: How far from the node cars were seen [m].
        linear, square: Coefficients of the parabola [1, 1/m].
        cars: Number of cars.
    """

    node: float
    sign: int
    seen: float
    linear: float
    square: float
    cars: int

    def at(self, x: FloatArray) -> FloatArray:
        """Correction to the right [m] at x [m past the gore]."""
        away = np.maximum(self.sign * (x - self.node), 0.0)
        inside = np.minimum(away, self.seen)
        fading = np.clip(1.0 - (away - inside) / FADE, 0.0, 1.0)
        return (self.linear * inside + self.square * inside**2) * fading


def fit_correction(frame: Frame, lane: Line, cars: pd.DataFrame, node: float, sign: int) -> Correction:
    """Least squares over trajectory rows (Local_X, Local_Y in feet) of one lane, away from its node."""
    x, r = frame.road(cars["Local_X"].to_numpy(float), cars["Local_Y"].to_numpy(float))
    off = lane.locate(frame.place(x, r))[1]
    away = sign * (x - node)
    kept = away > 0.0
    columns = np.column_stack([away[kept], away[kept] ** 2])
    (linear, square), *_ = np.linalg.lstsq(columns, off[kept], rcond=None)
    count = len(cars[["segment", "Vehicle_ID"]].drop_duplicates())
    return Correction(node, sign, float(away.max()), float(linear), float(square), count)


def led(frame: Frame, lane: Line, node: float, aside: float, correction: Correction | None = None) -> Line:
    """A drawn line, corrected, and led to r = `aside` at x = `node`, where it begins or ends.

    The line is cut off at the node, whichever of its parts lies on the other side of the auxiliary lane.
    """
    x, r = frame.locate(lane.at(np.arange(0.0, lane.length, 1.0)))
    sign = correction.sign if correction else -1
    kept = sign * (x - node) > 0.0
    x, r = np.append(x[kept], node), np.append(r[kept], aside)
    order = np.argsort(x)
    x, r = x[order], r[order]
    if correction:
        r = r + correction.at(x)
    share = np.clip(1.0 - np.abs(x - node) / BLEND, 0.0, 1.0)
    return Line(frame.place(x, share * aside + (1.0 - share) * r))


def up_to(line: Line, point: FloatArray) -> Line:
    """A line up to the foot of a point."""
    return line.part(0.0, float(line.locate(point[None])[0][0]))


def onward(line: Line, point: FloatArray) -> Line:
    """A line from the foot of a point on."""
    return line.part(float(line.locate(point[None])[0][0]), line.length)


def joined(first: Line, second: Line) -> Line:
    """One line after the other, rounded where they meet."""
    return Line(np.vstack([first.points, second.points[1:]]), TURN).smooth(TURN, 1.0)

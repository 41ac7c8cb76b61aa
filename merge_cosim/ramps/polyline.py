"""Lines of points in the plane, arrays of shape (points, 2) in metres, in driving order."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from merge_cosim.core.units import FloatArray

MIN_SPACING = 0.5
"""Points nearer than this to the one before are left out [m]; their direction would be rounding."""


def length(line: FloatArray) -> float:
    """Way along a line [m]."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def ways(line: FloatArray) -> FloatArray:
    """Way along a line to each of its points [m], shape (points,)."""
    return np.append(0.0, np.hypot(*np.diff(line, axis=0).T).cumsum())


def through(points: Sequence[Any]) -> FloatArray:
    """A line through points, without those too near to the one before; the first and the last stay."""
    kept = [points[0]]
    for point in points[1:-1]:
        if min(np.hypot(*np.subtract(point, other)) for other in (kept[-1], points[-1])) >= MIN_SPACING:
            kept.append(point)
    return np.array([*kept, points[-1]], dtype=float)


def directions(line: FloatArray) -> FloatArray:
    """Unit vector along the line at each point, halfway between the two segments that meet there."""
    segments = np.diff(line, axis=0)
    segments = segments / np.hypot(*segments.T)[:, None]
    joined = np.vstack([segments[:1], segments[:-1] + segments[1:], segments[-1:]])
    return np.asarray(joined / np.maximum(np.hypot(*joined.T), 1e-9)[:, None])


def left_of(direction: FloatArray) -> FloatArray:
    """Directions turned left by a right angle."""
    return np.stack([-direction[..., 1], direction[..., 0]], axis=-1)


def beside(line: FloatArray, left: float) -> FloatArray:
    """A line at a constant distance to the left [m] (negative: to the right)."""
    along = directions(line)
    ends = np.diff(line, axis=0)
    ends = ends / np.hypot(*ends.T)[:, None]
    # In a bend a point moves further out, so that the segments keep their distance.
    bend = np.maximum((along * np.vstack([ends[:1], ends])).sum(axis=1), 0.5)
    return np.asarray(line + left_of(along) * (left / bend)[:, None])


def with_length(line: FloatArray, wanted: float, at_start: bool) -> FloatArray:
    """The line cut, or made longer straight on, to `wanted` metres at its start or its end."""
    if at_start:
        return with_length(line[::-1], wanted, at_start=False)[::-1]
    way = ways(line)
    last = min(max(int(np.searchsorted(way, wanted - MIN_SPACING)), 1), len(line) - 1)
    direction = (line[last] - line[last - 1]) / (way[last] - way[last - 1])
    return np.vstack([line[:last], line[last - 1] + direction * (wanted - way[last - 1])])


def nearest_on(start: FloatArray, end: FloatArray, point: FloatArray) -> FloatArray:
    """The point of the segment from `start` to `end` that is nearest to another."""
    way = end - start
    share = float(way @ (point - start)) / max(float(way @ way), 1e-9)
    return np.asarray(start + min(max(share, 0.0), 1.0) * way)

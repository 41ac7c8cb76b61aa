"""What the survey says of a main road: the spacing of its lanes and the middle of the road."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.lines import Line
from merge_cosim.core.units import FloatArray

STEP = 2.0
"""Distance between the places where lines are compared [m]."""
SMOOTHING = 30.0
"""The tracing's own wobble, some 0.15 m over 15 m, is averaged over this length [m]."""


def across(reference: Line, line: Line, stations: FloatArray) -> FloatArray:
    """How far to the right of a reference another line runs at stations of the reference [m]; nan where it does not."""
    along, right = reference.locate(line.at(np.arange(0.0, line.length, STEP)))
    order = np.argsort(along)
    return np.interp(stations, along[order], right[order], left=np.nan, right=np.nan)


def strip_widths(reference: Line, edges: Sequence[Line]) -> FloatArray:
    """Mean widths [m] of the strips between neighbouring edges, from left to right."""
    stations = np.arange(0.0, reference.length, STEP)
    return np.nanmean(np.diff([across(reference, edge, stations) for edge in edges], axis=0), axis=1)


def lane_centres(widths: FloatArray) -> FloatArray:
    """Where the lanes' centres lie, to the right of the road's middle [m], from left to right."""
    return np.cumsum(widths) - widths / 2 - widths.sum() / 2


def middle(reference: Line, centres: Sequence[Line], widths: FloatArray) -> Line:
    """The middle of a road: where lanes of these widths lie best on the drawn centre lines.

    Args:
        reference: A line along the whole road.
        centres: Drawn centre lines of the lanes, from left to right; a line may end early.
        widths: Width of each lane [m].
    """
    stations = np.arange(0.0, reference.length, STEP)
    drawn = np.array([across(reference, centre, stations) for centre in centres])
    offsets = lane_centres(widths)
    return Line(reference.place(stations, np.nanmean(drawn - offsets[:, None], axis=0))).smooth(SMOOTHING)

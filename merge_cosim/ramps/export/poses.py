"""Where cars lie in the plane: from stations on a path to centres and headings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from merge_cosim.core.units import FloatArray
from merge_cosim.ramps.export.lanelets import Lanelet
from merge_cosim.ramps.ramp import Ramp, Section, Way

SIDEWAYS = 20.0
"""Way over which a lane change is drawn before and after the merging point [m]; in a run it takes one cycle."""
HEADING_STEP = 0.5
"""Metres ahead and behind between which a heading is taken."""


def poses(
    road: Mapping[str, Lanelet], ramp: Ramp, path: Way, station: FloatArray, length: float, merge_position: float
) -> tuple[FloatArray, FloatArray]:
    """Where a car is that drives in the middle of its lanelets.

    The merging car moves sideways over `SIDEWAYS` metres before and after the merging point, as far as the auxiliary
    lane reaches, so that its front is halfway between the lanes where the run changes lane.

    Args:
        road: The ramp's lanelets by SUMO lane id.
        ramp: The ramp.
        path: The car's path.
        station: Stations of its front bumper [m], shape (n,).
        length: Its length [m].
        merge_position: The merging point [m past the gore].

    Returns:
        The car's centres [m], shape (n, 2), and its headings [rad], shape (n,).
    """
    before = min(SIDEWAYS, merge_position)
    after = min(SIDEWAYS, ramp.auxiliary_end - merge_position)
    onward = tuple(section for section in ramp.main if section.start >= 0.0)

    def points(front: FloatArray) -> FloatArray:
        x = front + merge_position - 0.5 * length
        if path == "main":
            return _along(road, ramp.main, x)
        if not ramp.changes_lane:
            return _along(road, (*ramp.ramp, *onward), x)
        share = np.clip((front + before) / (before + after), 0.0, 1.0)[:, None]
        share = share**2 * (3.0 - 2.0 * share)
        return np.asarray((1.0 - share) * _along(road, ramp.ramp, x) + share * _along(road, ramp.main, x))

    ahead = points(station + HEADING_STEP) - points(station - HEADING_STEP)
    return points(station), np.arctan2(ahead[:, 1], ahead[:, 0])


def _along(road: Mapping[str, Lanelet], sections: Sequence[Section], x: FloatArray) -> FloatArray:
    """Points at x [m past the gore], shape (n,), in the lanes of a path's sections; shape (n, 2)."""
    which = np.maximum(np.searchsorted([section.start for section in sections], x, side="right") - 1, 0)
    points = np.empty((len(x), 2))
    for number, section in enumerate(sections):
        rows = which == number
        points[rows] = road[f"{section.edge}_{section.lane}"].at(x[rows] - section.start)
    return points

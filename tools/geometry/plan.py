"""A ramp as netconvert takes it: nodes, edges with their lanes, connections."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from geometry.frame import Frame
from geometry.lines import Line
from geometry.ramp_lanes import Correction
from merge_cosim.core.units import FloatArray

TOLERANCE = 0.02
"""Corners are left out where the shape changes by less than this [m]."""


@dataclass(frozen=True)
class Edge:
    """A road between two nodes.

    Attributes:
        name: Its id.
        start, end: Ids of its nodes.
        shape: Its middle, in the metric state plane.
        lanes: Role and width [m] of each lane, from the right.
        length: What SUMO drives [m].
        own_shapes: Shapes of lanes, by index, that do not run beside the others.
    """

    name: str
    start: str
    end: str
    shape: Line
    lanes: tuple[tuple[str, float], ...]
    length: float
    own_shapes: dict[int, Line] = field(default_factory=dict)

    @property
    def width(self) -> float:
        """Of all lanes [m]."""
        return sum(width for _, width in self.lanes)

    def with_own_shape(self, lane: int, shape: Line) -> Edge:
        """The same road with a lane that goes its own way."""
        return replace(self, own_shapes={**self.own_shapes, lane: shape})


@dataclass(frozen=True)
class Plan:
    """One ramp.

    Attributes:
        name: Name of its folder.
        frame: The road's coordinates.
        tied: The same by the published rows alone, before cars set the zero of Local_X.
        projection: Projection of the metric state plane, as PROJ has it.
        origin: Point of the metric state plane that is (0, 0) in the net [m].
        joints: x of the nodes where lanes begin or end [m past the gore], and how far these reach to the left and to
            the right of the axis [m].
        edges: Its roads.
        connections: From edge, lane, to edge, lane.
        surveyed: Where the survey of the main road and of the ramp begins and ends [m past the gore], by the key that
            `ramp.toml` has for it.
        corrections: Correction of the drawn line by trajectories, by NGSIM lane.
    """

    name: str
    frame: Frame
    tied: Frame
    projection: str
    origin: FloatArray
    joints: dict[str, tuple[float, float, float]]
    edges: tuple[Edge, ...]
    connections: tuple[tuple[str, int, str, int], ...]
    surveyed: dict[str, float]
    corrections: dict[int, Correction]

    def local(self, points: FloatArray) -> FloatArray:
        """Coordinates in the net of points in the metric state plane."""
        return points - self.origin


def main_edges(
    frame: Frame,
    names: tuple[str, str, str],
    nodes: tuple[str, ...],
    widths: FloatArray,
    extra: float,
    ends: FloatArray,
) -> tuple[Edge, Edge, Edge]:
    """The main road: before the gore, beside the auxiliary lane, beyond it.

    Args:
        frame: The road's coordinates.
        names: Ids of the three edges.
        nodes: Ids of the four nodes.
        widths: Widths of the main lanes [m], from the left.
        extra: Width of the auxiliary lane [m].
        ends: x of the four nodes [m past the gore].
    """
    roles = ["host", *["main"] * (len(widths) - 1)]
    lanes = tuple(zip(roles, np.round(widths[::-1], 2).tolist(), strict=True))
    edges = []
    for number, name in enumerate(names):
        beside = number == 1
        start, end = ends[number] + frame.gore, ends[number + 1] + frame.gore
        stations = start + frame.axis.part(start, end).stations
        edges.append(
            Edge(
                name,
                nodes[number],
                nodes[number + 1],
                Line(frame.axis.place(stations, extra / 2 if beside else 0.0)).simple(TOLERANCE),
                ((("auxiliary", extra), *lanes) if beside else lanes),
                round(float(ends[number + 1] - ends[number]), 2),
            )
        )
    return edges[0], edges[1], edges[2]


def through_connections(names: tuple[str, str, str], lanes: int) -> tuple[tuple[str, int, str, int], ...]:
    """Connections of the main lanes: beside the auxiliary lane each has one index more."""
    before, beside, beyond = names
    onto = [(before, lane, beside, lane + 1) for lane in range(lanes)]
    return (*onto, *((beside, lane + 1, beyond, lane) for lane in range(lanes)))

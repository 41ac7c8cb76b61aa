"""Draw a course through a net again: roads from node to node, every lane of the host's path continuous."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from merge_cosim.core.units import FloatArray
from merge_cosim.ramps import polyline
from merge_cosim.ramps.infer import Course
from merge_cosim.ramps.paths import Edge, Lane, keeps_left

EXIT_LENGTH = 300.0
"""As much of an off-ramp is kept [m]."""
MIN_EDGE = 10.0
"""A piece of road shorter than this at the end of a path is left out [m]."""
SMOOTHING = 5.0
"""Metres of road over which an offset of one metre is spread, on either side of a node."""
HALF_NODE = 1.0
"""Half the length of a joining node's shape along the road [m]; netconvert stretches its own at shallow angles."""


@dataclass(frozen=True)
class Road:
    """One edge, drawn.

    Attributes:
        lane: The lane of a path on it.
        start: Node where it begins.
        end: Node where it ends.
        axis: The middle of all its lanes, from node to node.
    """

    lane: Lane
    start: str
    end: str
    axis: FloatArray

    @property
    def edge(self) -> Edge:
        """The edge in the net."""
        return self.lane.getEdge()

    @property
    def length(self) -> float:
        """Its length [m], rounded to the centimetres that netconvert writes."""
        return round(polyline.length(self.axis), 2)


@dataclass(frozen=True)
class Node:
    """A node.

    Attributes:
        place: Where it is [m].
        corners: Corners of its shape [m], shape (4, 2); empty at a road's end.
    """

    place: FloatArray
    corners: FloatArray


@dataclass(frozen=True)
class Layout:
    """A ramp's roads as they will be written, with the gore at (0, 0).

    Attributes:
        main: The main road, in driving order.
        gore: Index of its first road after the gore.
        ramp: The on-ramp before the gore.
        exit: The off-ramp at the acceleration lane's end, if there is one.
        origin: Where the gore lies in the net's own coordinates [m].
        surveyed: Where [m past the gore] the net ended and road was added, by key of `ramp.toml`'s extensions.
    """

    main: list[Road]
    gore: int
    ramp: list[Road]
    exit: list[Road]
    origin: FloatArray
    surveyed: dict[str, float]

    @property
    def roads(self) -> list[Road]:
        """All of them."""
        return self.main + self.ramp + self.exit


def lay_out(course: Course, upstream: float, downstream: float) -> Layout:
    """Draw the roads of a course, cut or lengthened straight on to the given reaches from the gore [m].

    The host's lane is taken from the net and all other lanes of its edges lie beside it, so that it is continuous where
    the number of lanes changes. The on-ramp's lane ends where its acceleration lane begins.
    """
    count = course.before
    host, own = _lines(course.main), _lines(course.ramp)
    origin = host[count][0]
    target = _aside(host[count], course.main[count], course.beside[0])[0] if course.beside else origin
    own[-1] = _ending_at(own[-1], target, polyline.directions(host[count])[0])
    main = _roads(course.main, host, "main_start", "main_end", origin)
    ramp = _roads(course.ramp, own, "ramp_start", main[count].start, origin)
    before, main_before = _reaching(main[:count], upstream, at_start=True)
    after, main_after = _reaching(main[count:], downstream, at_start=False)
    ramp, ramp_before = _reaching(ramp, upstream, at_start=True)
    reached = {"main_before": main_before, "main_after": main_after, "ramp_before": ramp_before}
    return Layout(
        main=before + after,
        gore=len(before),
        ramp=ramp,
        exit=_exit(course, host, after, origin),
        origin=origin,
        surveyed={key: round(x, 1) for key, x in reached.items() if x is not None},
    )


def nodes(roads: Sequence[Road]) -> dict[str, Node]:
    """Nodes by id. Where roads meet, the shape is a short piece of the first one's road, as wide as all of them."""
    met: dict[str, list[tuple[FloatArray, FloatArray, float]]] = {}
    for road in roads:
        half, along = sum(lane.getWidth() for lane in road.edge.getLanes()) / 2, polyline.directions(road.axis)
        for node, at in ((road.start, 0), (road.end, -1)):
            met.setdefault(node, []).append((road.axis[at], along[at], half))
    found = {}
    for name, ends in met.items():
        place, along, _ = ends[0]
        corners = np.empty((0, 2))
        if len(ends) > 1:
            left = polyline.left_of(along)
            sides = [float((end - place) @ left) + side * half for end, _, half in ends for side in (-1, 1)]
            around = ((-1, min(sides)), (-1, max(sides)), (1, max(sides)), (1, min(sides)))
            corners = np.array([place + way * HALF_NODE * along + side * left for way, side in around])
        found[name] = Node(place, corners)
    return found


def _lines(lanes: Sequence[Lane]) -> list[FloatArray]:
    """Axes of lanes from node to node: the net's, which end where its junctions begin, joined to each other."""
    shapes = [np.array(lane.getShape(), dtype=float) for lane in lanes]
    joints = [
        polyline.nearest_on(shape[-1], onward[0], np.array(lane.getEdge().getToNode().getCoord(), dtype=float))
        for lane, (shape, onward) in zip(lanes, pairwise(shapes), strict=False)
    ]
    # Where the net's lanes are set off sideways at a node, the offset is spread over some road before and after it.
    spread = [
        SMOOTHING * abs(float((onward[0] - shape[-1]) @ polyline.left_of(polyline.directions(shape)[-1])))
        for shape, onward in pairwise(shapes)
    ]
    starts, ends = [shapes[0][0], *joints], [*joints, shapes[-1][-1]]
    lines = []
    for shape, start, end, before, after in zip(shapes, starts, ends, [0.0, *spread], [*spread, 0.0], strict=True):
        far = (np.hypot(*(shape - start).T) >= before) & (np.hypot(*(shape - end).T) >= after)
        lines.append(polyline.through([start, *shape[far], end]))
    return lines


def _roads(lanes: Sequence[Lane], lines: Sequence[FloatArray], first: str, last: str, origin: FloatArray) -> list[Road]:
    """Roads end to end between two named nodes."""
    inner = [lane.getEdge().getToNode().getID() for lane in lanes[:-1]]
    ends = zip(lanes, lines, [first, *inner], [*inner, last], strict=True)
    return [Road(lane, start, end, _centre(line, lane) - origin) for lane, line, start, end in ends]


def _reaching(roads: list[Road], wanted: float, at_start: bool) -> tuple[list[Road], float | None]:
    """Roads cut or lengthened at one end to `wanted` metres together, and where they ended if that was too near."""
    total = sum(road.length for road in roads)
    kept, name = list(roads), roads[0].start if at_start else roads[-1].end
    outer = 0 if at_start else -1
    while len(kept) > 1 and sum(road.length for road in kept) - kept[outer].length > wanted - MIN_EDGE:
        kept.pop(outer)
    needed = wanted - (sum(road.length for road in kept) - kept[outer].length)
    axis = polyline.with_length(kept[outer].axis, round(needed, 2), at_start)
    ends = {"start": name} if at_start else {"end": name}
    kept[outer] = replace(kept[outer], axis=axis, **ends)
    return kept, None if total >= wanted else (-total if at_start else total)


def _exit(course: Course, host: list[FloatArray], after: list[Road], origin: FloatArray) -> list[Road]:
    """The off-ramp that the acceleration lane leads to, up to `EXIT_LENGTH`."""
    if course.exit is None:
        return []
    last = len(course.beside) - 1
    aside = _aside(host[course.before + last], course.main[course.before + last], course.beside[last])
    start, along = aside[-1], polyline.directions(aside)[-1]
    line = polyline.through([start, *(point for point in course.exit.getShape() if (point - start) @ along > 1.0)])
    line = polyline.with_length(line, min(polyline.length(line), EXIT_LENGTH), at_start=False)
    return [Road(course.exit, after[last].end, "exit_end", _centre(line, course.exit) - origin)]


def _ending_at(line: FloatArray, target: FloatArray, along: FloatArray) -> FloatArray:
    """A line without the points beyond the target, led to the target."""
    ahead = [point for point in line[1:-1] if (point - target) @ along < -1.0]
    return polyline.through([line[0], *ahead, target])


def _aside(line: FloatArray, lane: Lane, other: Lane) -> FloatArray:
    """Axis of another lane of the same edge, from a lane's."""
    return polyline.beside(line, _side(lane) * (_from_outside(other) - _from_outside(lane)))


def _centre(line: FloatArray, lane: Lane) -> FloatArray:
    """Middle of an edge, from a lane's axis."""
    width = sum(each.getWidth() for each in lane.getEdge().getLanes())
    return polyline.beside(line, _side(lane) * (width / 2 - _from_outside(lane)))


def _side(lane: Lane) -> int:
    """1 where lanes are counted from the right, -1 where traffic keeps left and they are counted from there."""
    return -1 if keeps_left(lane.getEdge()) else 1


def _from_outside(lane: Lane) -> float:
    """Distance from its edge's outer border, that of lane 0, to a lane's axis [m]."""
    further_out = lane.getEdge().getLanes()[: lane.getIndex()]
    return float(sum(each.getWidth() for each in further_out) + lane.getWidth() / 2)

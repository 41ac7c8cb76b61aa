"""The lanes of a ramp as lanelets: left and right boundaries that neighbours share and that run on through junctions.

SUMO draws a lane by its middle and its width, and cuts it off at junctions. A lanelet needs boundaries, the same points
for two neighbours, and ends that are the next one's beginning. Bender, Ziegler, Stiller: Lanelets: Efficient map
representation for autonomous driving, IV 2014.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sumolib

from merge_cosim.core.units import FloatArray
from merge_cosim.ramps import polyline
from merge_cosim.ramps.ramp import Ramp, read_net

DRIVER = "passenger"
"""SUMO's class of the cars; lanes closed to it are left out."""

Corner = tuple[str, int, bool]
"""Where a boundary ends: its edge, its number from the right, and whether it is the start."""


@dataclass(frozen=True)
class Lanelet:
    """One lane of one edge.

    Attributes:
        edge: The edge.
        lane: SUMO index of the lane.
        length: SUMO's length of the lane [m], by which positions are measured.
        speed_limit: Speed limit [m/s].
        left: Left boundary in the net's coordinates [m], shape (points, 2), in driving order.
        right: Right boundary, same shape.
        follows: SUMO ids of the lanes that it begins at.
        leads_to: SUMO ids of the lanes that begin where it ends.
        left_lane: SUMO id of its left neighbour, if any.
        right_lane: SUMO id of its right neighbour, if any.
    """

    edge: str
    lane: int
    length: float
    speed_limit: float
    left: FloatArray
    right: FloatArray
    follows: tuple[str, ...] = ()
    leads_to: tuple[str, ...] = ()
    left_lane: str | None = None
    right_lane: str | None = None

    @property
    def middle(self) -> FloatArray:
        """The line halfway between the boundaries [m], shape (points, 2)."""
        return 0.5 * (self.left + self.right)

    def ways(self) -> FloatArray:
        """SUMO position of each point of the middle [m], shape (points,); the last is the lane's length."""
        way = polyline.ways(self.middle)
        return way * (self.length / way[-1])

    def at(self, position: FloatArray) -> FloatArray:
        """Points of the middle at SUMO positions [m] of shape (n,), shape (n, 2); straight on past either end."""
        return _between(self.middle, self.ways(), position)

    def area_from(self, position: float) -> FloatArray:
        """Corners of the lane's area from a SUMO position [m] on, shape (corners, 2)."""
        ways = self.ways()
        kept = np.append(position, ways[ways > position + 1e-6])
        sides = [_between(side, ways, kept) for side in (self.right, self.left)]
        return np.concatenate([sides[0], sides[1][::-1]])


def lanelets(ramp: Ramp) -> dict[str, Lanelet]:
    """Lanelets of the edges of both paths and of whatever else begins or ends between two of these, by SUMO lane id."""
    net = read_net(ramp.net)
    lanes = {edge.getID(): _lanes(edge) for edge in _edges(net, ramp)}
    lines = {(edge, number): line for edge in lanes for number, line in enumerate(_boundaries(lanes[edge]))}
    links = list(_links(lanes))
    _join(lines, links, lanes)
    found = {}
    for edge, row in lanes.items():
        ids: list[str | None] = [None, *(str(lane.getID()) for lane in row), None]
        for number, lane in enumerate(row):
            found[str(lane.getID())] = Lanelet(
                edge=edge,
                lane=int(lane.getIndex()),
                length=float(lane.getLength()),
                speed_limit=float(lane.getSpeed()),
                left=lines[edge, number + 1],
                right=lines[edge, number],
                left_lane=ids[number + 2],
                right_lane=ids[number],
            )
    for before, after in links:
        a, b = str(before.getID()), str(after.getID())
        found[a] = replace(found[a], leads_to=(*found[a].leads_to, b))
        found[b] = replace(found[b], follows=(*found[b].follows, a))
    return found


def _edges(net: sumolib.net.Net, ramp: Ramp) -> list[sumolib.net.edge.Edge]:
    paths = [[net.getEdge(section.edge) for section in path] for path in (ramp.main, ramp.ramp)]
    found = {edge.getID(): edge for path in paths for edge in path}
    for node in [edge.getToNode() for path in paths for edge in path[:-1]]:
        for edge in (*node.getIncoming(), *node.getOutgoing()):
            if _lanes(edge):
                found[edge.getID()] = edge
    return [found[name] for name in sorted(found)]


def _lanes(edge: sumolib.net.edge.Edge) -> list[sumolib.net.lane.Lane]:
    return [lane for lane in edge.getLanes() if lane.allows(DRIVER)]


def _boundaries(row: Sequence[sumolib.net.lane.Lane]) -> list[FloatArray]:
    """The lines between and beside an edge's lanes, from the right, with as many points each.

    Between two lanes it is the left one's edge, so that a lane that runs slantwise into its neighbour tapers.
    """
    shapes = [np.array(lane.getShape(), dtype=float) for lane in row]
    ways = [polyline.ways(shape) for shape in shapes]
    shares = np.unique(np.concatenate([way / way[-1] for way in ways]))
    spacing = polyline.MIN_SPACING / min(way[-1] for way in ways)
    kept = [0.0]
    for share in shares[1:]:
        if share - kept[-1] >= spacing and 1.0 - share >= spacing:
            kept.append(float(share))
    middles = [_between(shape, way / way[-1], np.array([*kept, 1.0])) for shape, way in zip(shapes, ways, strict=True)]
    half = [0.5 * float(lane.getWidth()) for lane in row]
    right = [polyline.beside(middle, -width) for middle, width in zip(middles, half, strict=True)]
    return [*right, polyline.beside(middles[-1], half[-1])]


def _links(
    lanes: Mapping[str, list[sumolib.net.lane.Lane]],
) -> Iterator[tuple[sumolib.net.lane.Lane, sumolib.net.lane.Lane]]:
    """Connections that lead straight on; one is left out where a straighter one begins and another ends with it."""
    every = [
        (lane, link.getToLane(), _sideways(lane, link.getToLane()))
        for row in lanes.values()
        for lane in row
        for link in lane.getOutgoing()
        if link.getTo().getID() in lanes and link.getToLane().allows(DRIVER)
    ]
    for before, after, offset in every:
        from_here = min(other for lane, _, other in every if lane is before)
        to_there = min(other for _, lane, other in every if lane is after)
        if offset <= from_here or offset <= to_there:
            yield before, after


def _sideways(before: sumolib.net.lane.Lane, after: sumolib.net.lane.Lane) -> float:
    """How far a connection leads sideways [m], seen from its two ends."""
    first, second = (np.array(lane.getShape(), dtype=float) for lane in (before, after))
    step = second[0] - first[-1]
    ends = (polyline.directions(first)[-1], polyline.directions(second)[0])
    return float(sum(abs(step @ polyline.left_of(direction)) for direction in ends))


def _join(
    lines: dict[tuple[str, int], FloatArray],
    links: Sequence[tuple[sumolib.net.lane.Lane, sumolib.net.lane.Lane]],
    lanes: Mapping[str, list[sumolib.net.lane.Lane]],
) -> None:
    """Carry boundaries on to where they meet, halfway through the junction."""
    number = {lane.getID(): place for row in lanes.values() for place, lane in enumerate(row)}
    group: dict[Corner, set[Corner]] = {}
    for before, after in links:
        for side in (0, 1):
            ends: tuple[Corner, Corner] = (
                (before.getEdge().getID(), number[before.getID()] + side, False),
                (after.getEdge().getID(), number[after.getID()] + side, True),
            )
            joined = set(ends).union(*(group.get(end, ()) for end in ends))
            group.update(dict.fromkeys(joined, joined))
    cut = {corner: lines[corner[:2]][0 if corner[2] else -1] for corner in group}
    meeting = {corner: _halfway(corner, group[corner], cut) for corner in group}
    for edge, row in lanes.items():
        for start in (True, False):
            corners: list[Corner] = [(edge, place, start) for place in range(len(row) + 1)]
            steps = [float(np.hypot(*(meeting[c] - cut[c]))) for c in corners if c in meeting]
            if not steps:
                continue
            for corner in corners:
                line = lines[corner[:2]][::-1] if start else lines[corner[:2]]
                on = line[-1] + polyline.directions(line)[-1] * np.mean(steps)  # beside lanes that lead somewhere
                end = meeting.get(corner, on)
                line = np.vstack([line if max(steps) >= polyline.MIN_SPACING else line[:-1], end])
                lines[corner[:2]] = line[::-1] if start else line


def _halfway(corner: Corner, group: set[Corner], cut: Mapping[Corner, FloatArray]) -> FloatArray:
    """Where the boundaries of a group meet: halfway between those that end and those that begin."""
    sides = [np.mean([cut[other] for other in sorted(group) if other[2] == start], axis=0) for start in (True, False)]
    return np.asarray(0.5 * (sides[0] + sides[1]))


def _between(line: FloatArray, ways: FloatArray, wanted: FloatArray) -> FloatArray:
    """Points of a line, whose points lie at `ways`, at other ways; straight on past either end."""
    after = np.clip(np.searchsorted(ways, wanted), 1, len(line) - 1)
    share = (wanted - ways[after - 1]) / (ways[after] - ways[after - 1])
    return np.asarray(line[after - 1] + share[:, None] * (line[after] - line[after - 1]))

"""Plain XML, netconvert's and netedit's sources, of a ramp that was drawn from a net."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import sumolib
from sumolib.net.lane import SUMO_VEHICLE_CLASSES, SUMO_VEHICLE_CLASSES_DEPRECATED

from merge_cosim.core.units import FloatArray
from merge_cosim.ramps.create.folder import document
from merge_cosim.ramps.create.layout import Layout, Road, nodes
from merge_cosim.ramps.infer import Course
from merge_cosim.ramps.paths import Lane
from merge_cosim.ramps.view import ROLES

CLASSES = SUMO_VEHICLE_CLASSES - SUMO_VEHICLE_CLASSES_DEPRECATED
"""Vehicle classes that netconvert takes without a warning."""


class PlainXml:
    """Plain XML of a layout.

    Args:
        net: The net it comes from.
        path: The course that was drawn.
        layout: What is written.
        speed_limit: Speed limit of the main road [m/s].
        raised: Only its slower lanes get it, instead of all.
    """

    def __init__(self, net: sumolib.net.Net, path: Course, layout: Layout, speed_limit: float, raised: bool) -> None:
        self._raised = raised
        self._net, self._layout, self._speed_limit = net, layout, speed_limit
        self._nodes = nodes(layout.roads)
        self._joins = not path.beside
        self._merging = {lane.getEdge().getID(): lane.getIndex() for lane in path.beside}

    def nodes(self) -> str:
        """Content of the `.nod.xml`."""
        gore = self._layout.main[self._layout.gore].start
        rows = self._location()
        for name, node in self._nodes.items():
            kind = "unregulated"
            if not len(node.corners):
                kind = "dead_end"
            elif name == gore and self._joins:
                kind = "zipper"  # SUMO's own drivers let each other in by turns
            shape = f' radius="1" shape="{_points(node.corners)}"' if len(node.corners) else ""
            x, y = (f"{value + 0.0:.2f}" for value in node.place)
            rows.append(f'<node id={quoteattr(name)} x="{x}" y="{y}" type="{kind}"{shape}/>')
        comment = "Metres; (0, 0) is the axis of the host's lane at the gore. Joining nodes carry a shape 2 m long."
        return document("nodes", comment, rows)

    def edges(self) -> str:
        """Content of the `.edg.xml`."""
        rows: list[str] = []
        for road in self._layout.main:
            rows += self._edge(road, main=True)
        for road in self._layout.ramp:
            rows += self._edge(road, role="ramp")
        for road in self._layout.exit:
            rows += self._edge(road, role="exit")
        comment = "Each shape is the middle of its edge (spreadType center); length is what SUMO drives, node to node."
        return document("edges", comment, rows)

    def connections(self) -> str:
        """Content of the `.con.xml`."""
        kept = {road.edge.getID(): road.edge for road in self._layout.roads}
        links = [
            (edge.getID(), link.getFromLane().getIndex(), onward.getID(), link.getToLane().getIndex())
            for edge in kept.values()
            for onward, between in edge.getOutgoing().items()
            if onward.getID() in kept and self._meet(edge.getID(), onward.getID())
            for link in between
        ]
        rows = [
            f'<connection from={quoteattr(start)} fromLane="{lane}" to={quoteattr(end)} toLane="{onto}"/>'
            for start, lane, end, onto in sorted(set(links))
        ]
        return document("connections", "Every connection there is: lane 0 is the right-most lane.", rows)

    def _meet(self, edge: str, onward: str) -> bool:
        ends = {road.edge.getID(): road.end for road in self._layout.roads}
        starts = {road.edge.getID(): road.start for road in self._layout.roads}
        return ends[edge] == starts[onward]

    def _edge(self, road: Road, role: str = "main", main: bool = False) -> list[str]:
        lanes = road.edge.getLanes()
        name = f" name={quoteattr(road.edge.getName())}" if road.edge.getName() else ""
        closed = {_closed(lane) for lane in lanes}
        alike = closed.pop() if len(closed) == 1 else ""
        # netedit's Save Plain XML forgets a width that all lanes of an edge have, unless the edge has it.
        rows = [
            f"<edge id={quoteattr(road.edge.getID())} from={quoteattr(road.start)} to={quoteattr(road.end)}{name} "
            f'numLanes="{len(lanes)}" speed="{self._speed(lanes[-1], main):.2f}" width="{lanes[0].getWidth():.2f}" '
            f'spreadType="center"{alike} length="{road.length:.2f}" shape="{_points(road.axis)}">'
        ]
        # An on-ramp of several lanes brings as many, all on one side of the host's lane.
        side = self._merging.get(road.edge.getID(), road.lane.getIndex()) - road.lane.getIndex()
        for lane in lanes:
            own = role
            if main:
                from_host = lane.getIndex() - road.lane.getIndex()
                own = "host" if not from_host else "auxiliary" if from_host * side > 0 else "main"
            rows.append(
                f'    <lane index="{lane.getIndex()}" speed="{self._speed(lane, main):.2f}" '
                f'width="{lane.getWidth():.2f}"{"" if alike else _closed(lane)}>'
                f'<param key="role" value="{ROLES[own]}"/></lane>'
            )
        return [*rows, "</edge>"]

    def _speed(self, lane: Lane, main: bool) -> float:
        own = float(lane.getSpeed())
        if not main:
            return own
        return max(own, self._speed_limit) if self._raised else self._speed_limit

    def _location(self) -> list[str]:
        """Where the ramp lies on the globe, if the net knows it."""
        known = self._net._location
        if known.get("projParameter", "!") == "!":
            return []
        east, north = self._layout.origin
        offset_x, offset_y = map(float, known["netOffset"].split(","))
        points = [point for road in self._layout.roads for point in road.axis]
        west, south = (min(point[axis] for point in points) for axis in (0, 1))
        far_east, far_north = (max(point[axis] for point in points) for axis in (0, 1))
        boundary = f"{west:.2f},{south:.2f},{far_east:.2f},{far_north:.2f}"
        return [
            f'<location netOffset="{offset_x - east:.2f},{offset_y - north:.2f}" convBoundary="{boundary}" '
            f"origBoundary={quoteattr(known['origBoundary'])} projParameter={quoteattr(known['projParameter'])}/>"
        ]


def _closed(lane: Lane) -> str:
    """Attribute for the vehicle classes that a lane is closed to."""
    closed = sorted(CLASSES - set(lane.getPermissions()))
    return f' disallow="{" ".join(closed)}"' if closed else ""


def _points(line: FloatArray) -> str:
    return " ".join(f"{x + 0.0:.2f},{y + 0.0:.2f}" for x, y in line)

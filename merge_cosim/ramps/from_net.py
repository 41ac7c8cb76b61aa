"""Start a ramp of one's own from a SUMO net: the stretch around one on-ramp, as plain XML that can be edited and rebuilt."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import sumolib
from sumolib.net.lane import SUMO_VEHICLE_CLASSES

from merge_cosim.errors import UserError
from merge_cosim.ramps.definition import Extensions, RampFile
from merge_cosim.ramps.folder import document, require_new, write_ramp
from merge_cosim.ramps.infer import Course, Joint, Lane, course, joint_of, joints
from merge_cosim.ramps.layout import Layout, Road, lay_out, nodes
from merge_cosim.ramps.new import RampNumbers, default_merging_point
from merge_cosim.ramps.view import ROLES
from merge_cosim.units import FloatArray

MIN_AFTER = 100.0
"""Road kept beyond the acceleration lane's end, at least [m]."""


@dataclass(frozen=True)
class Origin:
    """What a net was made from, for error lines and `ramp.toml`.

    Attributes:
        file: The user's file.
        guessed: Parts of edge ids that netconvert gives where it guesses an acceleration lane.
        unlimited: Edges without a speed limit in the file, whose lanes have a stand-in's.
    """

    file: Path
    guessed: str | None = None
    unlimited: Collection[str] = ()


def ramp_from_net(
    folder: Path,
    net_file: Path,
    link: str | None = None,
    speed_limit: float | None = None,
    upstream: float = RampNumbers.upstream,
    downstream: float = RampNumbers.downstream,
    origin: Origin | None = None,
) -> Path:
    """Write the stretch around one on-ramp of a net into a new folder, and build it.

    Args:
        folder: Where to; its name is the ramp's.
        net_file: The SUMO net (`.net.xml` or `.net.xml.gz`).
        link: An edge of the on-ramp; it may be left out where the net has one on-ramp only.
        speed_limit: Speed limit of the main road [m/s]; the net's own if not given.
        upstream: Main road and on-ramp before the gore [m]; what the net lacks is added straight on.
        downstream: Road after the gore [m]; likewise.
        origin: What the net was made from, if it is not the user's own.

    Raises:
        UserError: The file is no net, or has no on-ramp, or several and `link` is not given.
    """
    require_new(folder)
    origin = origin or Origin(net_file)
    net = read_foreign_net(net_file, origin.file)
    try:
        joint, path = _choose(net, link, upstream, downstream)
    except UserError as error:
        raise UserError(f"{origin.file}: {error}") from None
    after = sum(lane.getLength() for lane in path.beside) + MIN_AFTER
    if after > downstream:
        raise UserError(f"{origin.file}: the acceleration lane is too long for the road; give --downstream {after:.0f}")
    layout = lay_out(path, upstream, downstream)
    limit = speed_limit or float(layout.main[layout.gore].lane.getSpeed())
    writer = _Writer(net, path, layout, speed_limit)
    definition = _definition(folder.name, joint, path, layout, limit, origin, given=speed_limit is not None)
    return write_ramp(folder, writer.nodes(), writer.edges(), writer.connections(), definition)


def read_foreign_net(path: Path, named: Path) -> sumolib.net.Net:
    """Read a net that is no ramp's yet; `named` is the file that error lines speak of.

    Raises:
        UserError: There is no such file, or it is no SUMO net with right-hand traffic.
    """
    if not path.is_file():
        raise UserError(f"{named}: no such file")
    try:
        net = sumolib.net.readNet(str(path), lxml=False)
        edges = net.getEdges()
    except Exception as error:  # sumolib passes on whatever its parser meets
        raise UserError(f"{named}: not a SUMO net (.net.xml, or .net.xml.gz): {error}") from None
    if not edges:
        raise UserError(f"{named}: no edge in it; is it a SUMO net (.net.xml)?")
    return net


def _choose(net: sumolib.net.Net, link: str | None, upstream: float, downstream: float) -> tuple[Joint, Course]:
    """The on-ramp meant, and its course."""
    if link is not None:
        try:
            joint = joint_of(net, link)
        except UserError as error:
            raise UserError(f"--link: {error}; {_listed(net, upstream, downstream)}") from None
        return joint, course(joint, upstream, downstream)
    found = joints(net)
    usable, reasons = [], []
    for joint in found:
        try:
            usable.append((joint, course(joint, upstream, downstream)))
        except UserError as error:
            reasons.append(str(error))
    if len(usable) == 1:
        return usable[0]
    if usable or not found:
        raise UserError(_listed(net, upstream, downstream))
    raise UserError("; ".join(reasons))


def _listed(net: sumolib.net.Net, upstream: float, downstream: float) -> str:
    """Which on-ramps there are, in one line."""
    shown = []
    for joint in joints(net):
        try:
            beside = sum(lane.getLength() for lane in course(joint, upstream, downstream).beside)
        except UserError:
            continue
        lane = f"acceleration lane {beside:.0f} m" if beside else "no acceleration lane"
        shown.append(f"{joint.link.getID()} (into {joint.gore.getID()}, {lane})")
    if not shown:
        return (
            "no on-ramp found: no edge of type motorway_link or trunk_link (or, in a net without such types, of fewer "
            "lanes or a lower limit) joins a main road at an acute angle; name the on-ramp's last edge with --link"
        )
    return f"{len(shown)} on-ramps; choose one with --link: {', '.join(shown)}"


class _Writer:
    """Plain XML of a layout."""

    def __init__(self, net: sumolib.net.Net, path: Course, layout: Layout, speed_limit: float | None) -> None:
        self._net, self._layout, self._speed_limit = net, layout, speed_limit
        self._nodes = nodes(layout.roads)
        self._joins = not path.beside
        self._merging = {lane.getID() for lane in (*path.ramp, *path.beside)}

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
        rows = [
            f"<edge id={quoteattr(road.edge.getID())} from={quoteattr(road.start)} to={quoteattr(road.end)}{name} "
            f'numLanes="{len(lanes)}" speed="{self._speed(lanes[-1], main):.2f}" spreadType="center"{alike} '
            f'length="{road.length:.2f}" shape="{_points(road.axis)}">'
        ]
        for lane in lanes:
            own = role
            if main:
                own = "host" if lane is road.lane else "auxiliary" if lane.getID() in self._merging else "main"
            rows.append(
                f'    <lane index="{lane.getIndex()}" speed="{self._speed(lane, main):.2f}" '
                f'width="{lane.getWidth():.2f}"{"" if alike else _closed(lane)}><param key="role" value="{ROLES[own]}"/></lane>'
            )
        return [*rows, "</edge>"]

    def _speed(self, lane: Lane, main: bool) -> float:
        return self._speed_limit if main and self._speed_limit else float(lane.getSpeed())

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
            f'origBoundary={quoteattr(known["origBoundary"])} projParameter={quoteattr(known["projParameter"])}/>'
        ]


def _closed(lane: Lane) -> str:
    """Attribute for the vehicle classes that a lane is closed to."""
    closed = sorted(SUMO_VEHICLE_CLASSES - set(lane.getPermissions()))
    return f' disallow="{" ".join(closed)}"' if closed else ""


def _points(line: FloatArray) -> str:
    return " ".join(f"{x + 0.0:.2f},{y + 0.0:.2f}" for x, y in line)


def _definition(
    name: str, joint: Joint, path: Course, layout: Layout, limit: float, origin: Origin, given: bool
) -> RampFile:
    """Contents of `ramp.toml`, with the source of each fact."""
    beside = [lane.getEdge().getID() for lane in path.beside]
    length = sum(road.length for road in layout.main if road.edge.getID() in beside)
    gore = layout.main[layout.gore]
    file, link, through = origin.file.name, joint.link, joint.through
    sources = {
        "geometry": f"{file}: its lanes, from node to node; the host's lane is kept, the others lie beside it.",
        "ramp": f"{file}: edge {link.getID()} ({link.getType() or 'no type'}) joins {through.getID()} at the gore.",
        "merging_point": "Default: a fifth of the acceleration lane." if beside else "The gore.",
        "speed_limit": f"{file}: lane {gore.lane.getID()}.",
    }
    if beside:
        sources["acceleration_lane"] = f"{file}: lane {path.beside[-1].getID()} {path.ending}."
        if origin.guessed and origin.guessed in beside[0]:
            sources["acceleration_lane"] = f"Guessed by netconvert, {length:.0f} m: {file} has none."
    if given:
        sources["speed_limit"] = "Given to merge-cosim ramp new."
    elif gore.edge.getID() in origin.unlimited:
        sources["speed_limit"] = f"SUMO's default for this kind of road: {file} has no maxspeed here."
    if layout.surveyed:
        sources["extensions"] = f"{file} ends there; straight road was added."
    return RampFile(
        title=_title(joint, name),
        net=f"{name}.net.xml",
        main=[road.edge.getID() for road in layout.main],
        host_lane=[road.lane.getIndex() for road in layout.main],
        ramp=[road.edge.getID() for road in layout.ramp] + beside,
        merging_lane=[road.lane.getIndex() for road in layout.ramp] + [lane.getIndex() for lane in path.beside],
        gore=gore.edge.getID(),
        merging_point=default_merging_point(length),
        speed_limit=round(limit, 2),
        lengths={road.edge.getID(): road.length for road in layout.roads},
        extensions=Extensions(**layout.surveyed),
        sources=sources,
    )


def _title(joint: Joint, name: str) -> str:
    """The road's name, where it has one."""
    road = joint.gore.getName() or joint.through.getName()
    return f"{name}: {joint.link.getName() or 'on-ramp'} onto {road}" if road else name

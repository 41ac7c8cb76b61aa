"""Start a ramp of one's own from a SUMO net: the stretch around one on-ramp, to be edited and rebuilt."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import sumolib
from lxml import etree

from merge_cosim.errors import UserError
from merge_cosim.ramps.definition import Extensions, RampFile
from merge_cosim.ramps.folder import require_new, write_ramp
from merge_cosim.ramps.infer import Course, Joint, course, joint_of, joints
from merge_cosim.ramps.layout import Layout, lay_out
from merge_cosim.ramps.new import RampNumbers, default_merging_point
from merge_cosim.ramps.plain import PlainXml

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
    net = _read(net_file, origin.file)
    try:
        joint, path = _choose(net, link, upstream, downstream)
    except UserError as error:
        raise UserError(f"{origin.file}: {error}") from None
    after = sum(lane.getLength() for lane in path.beside) + MIN_AFTER
    if after > downstream:
        raise UserError(f"{origin.file}: the acceleration lane is too long for the road; give --downstream {after:.0f}")
    layout = lay_out(path, upstream, downstream)
    limit = speed_limit or float(layout.main[layout.gore].lane.getSpeed())
    plain = PlainXml(net, path, layout, speed_limit)
    definition = _definition(folder.name, joint, path, layout, limit, origin, given=speed_limit is not None)
    return write_ramp(folder, plain.nodes(), plain.edges(), plain.connections(), definition)


def root_element(file: Path) -> etree._Element:
    """First element of an XML file, which may be compressed with gzip.

    Raises:
        UserError: The file is missing or no XML.
    """
    if not file.is_file():
        raise UserError(f"{file}: no such file")
    try:
        with gzip.open(file) if file.suffix == ".gz" else file.open("rb") as content:
            _, root = next(etree.iterparse(content, events=("start",)))
    except (etree.XMLSyntaxError, OSError, EOFError, zlib.error, StopIteration):
        raise UserError(f"{file}: not XML; a .pbf becomes OSM XML with: osmium cat FILE.osm.pbf -o FILE.osm") from None
    return root


def _read(path: Path, named: Path) -> sumolib.net.Net:
    """Read a net; `named` is the file that error lines speak of."""
    root = root_element(path)
    if root.tag != "net":
        more = "an extract of OpenStreetMap goes with --from-osm" if root.tag == "osm" else "give a .net.xml"
        raise UserError(f"{named}: its root is <{root.tag}>, not <net>; {more}")
    if root.get("lefthand", "false").lower() in ("true", "1", "yes"):
        raise UserError(f"{named}: a net with left-hand traffic; only right-hand traffic can be read")
    try:
        return sumolib.net.readNet(str(path))
    except Exception as error:  # sumolib passes on whatever its parser meets
        raise UserError(f"{named}: not a SUMO net: {error}") from None


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
    road = joint.gore.getName() or joint.through.getName() or joint.gore.getParam("ref")
    return f"{name}: {joint.link.getName() or 'on-ramp'} onto {road}" if road else name

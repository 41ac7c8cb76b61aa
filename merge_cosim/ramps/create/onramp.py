"""One on-ramp of a user's net: read the net, choose the on-ramp, and describe what was found."""

from __future__ import annotations

import html
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import sumolib
from lxml import etree

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import MOST_SPEED
from merge_cosim.core.xml_file import root_element
from merge_cosim.ramps.create.new import merging_point_source
from merge_cosim.ramps.infer import MAX_ANGLE, Course, Joint, course, joint_of, joints
from merge_cosim.ramps.paths import Lane
from merge_cosim.ramps.ramp import parsed_net


@dataclass(frozen=True)
class Origin:
    """What a net was made from, for error lines and `ramp.toml`.

    Attributes:
        file: The user's file.
        guessed: Parts of edge ids that netconvert gives where it guesses an acceleration lane.
        unlimited: Edges without a speed limit in the file, whose lanes have a stand-in's.
        advised: Edges that the file says to have no speed limit, whose lanes have the advisory speed.
        side: Why traffic keeps left, in words, where the file does not say it.
    """

    file: Path
    guessed: str | None = None
    unlimited: Collection[str] = ()
    advised: Collection[str] = ()
    side: str | None = None


def source_root(file: Path) -> etree._Element:
    """First element of the user's XML file, which may be compressed with gzip.

    Raises:
        UserError: The file is missing, no XML, or has a document type.
    """
    try:
        return root_element(file)
    except UserError as error:
        if "not XML" not in str(error):
            raise
        raise UserError(f"{error}; a .pbf becomes OSM XML with: osmium cat FILE.osm.pbf -o FILE.osm") from None


def read_source(path: Path, named: Path) -> sumolib.net.Net:
    """Read a net; `named` is the file that error lines speak of."""
    root = source_root(path)
    if root.tag != "net":
        more = "an extract of OpenStreetMap goes with --from-osm" if root.tag == "osm" else "give a .net.xml"
        raise UserError(f"{named}: its root is <{root.tag}>, not <net>; {more}")
    net = parsed_net(path, named)
    for edge in net.getEdges():
        edge._name = html.unescape(edge.getName() or "")  # netconvert escapes names of OpenStreetMap twice
    return net


def limit_of(lane: Lane, given: float | None, named: Path) -> float:
    """The speed limit that is given, else that of a lane of the main road [m/s]; `named` is the file of error lines.

    Raises:
        UserError: The lane's is none that a ramp can have.
    """
    if given is not None:
        return given
    limit = float(lane.getSpeed())
    if not 0.01 <= limit <= MOST_SPEED:
        raise UserError(
            f"{named}: the speed limit of '{lane.getEdge().getID()}' is {limit:g} m/s; give another with --speed-limit"
        )
    return limit


def choose(net: sumolib.net.Net, link: str | None, upstream: float, downstream: float) -> tuple[Joint, Course]:
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
            f"lanes or a lower limit) joins a main road at {MAX_ANGLE:g} degrees or less; name the on-ramp's last edge "
            "with --link"
        )
    many = f"{len(shown)} on-ramps; choose one" if len(shown) > 1 else "the one on-ramp is chosen"
    return f"{many} with --link: {', '.join(shown)}"


def sources_of(
    joint: Joint, path: Course, length: float, limit: float, origin: Origin, given: str | None
) -> dict[str, str]:
    """Where each fact of a ramp but its geometry comes from, in words.

    Args:
        joint: Where the on-ramp comes in.
        path: The two paths.
        length: Length of the acceleration lane [m].
        limit: Speed limit [m/s].
        origin: What the net was made from.
        given: The command to which the user has given the speed limit; None if it is the net's.
    """
    file, link, gore = origin.file.name, joint.link, path.main[path.before]
    kind = link.getType() or "no type"
    sources = {
        "ramp": f"{file}: edge {link.getID()} ({kind}) joins {joint.through.getID()} at the gore.",
        "merging_point": merging_point_source(length, limit),
        "speed_limit": f"{file}: lane {gore.getID()}.",
    }
    if origin.side:
        sources["side"] = origin.side
    if path.beside:
        sources["acceleration_lane"] = f"{file}: lane {path.beside[-1].getID()} {path.ending}."
        if origin.guessed and origin.guessed in path.beside[0].getEdge().getID():
            sources["acceleration_lane"] = f"Guessed by netconvert, {length:.0f} m: {file} has none."
    if given:
        sources["speed_limit"] = f"Given to {given}."
    elif gore.getEdge().getID() in origin.unlimited:
        sources["speed_limit"] = f"SUMO's default for this kind of road: {file} has no maxspeed here."
    elif gore.getEdge().getID() in origin.advised:
        sources["speed_limit"] = f"{file}: maxspeed=none; Germany's advisory speed of 130 km/h stands for it."
    return sources


def title_of(joint: Joint, name: str) -> str:
    """The road's name, where it has one."""
    road = joint.gore.getName() or joint.through.getName() or joint.gore.getParam("ref")
    return f"{name}: {joint.link.getName() or 'on-ramp'} onto {road}" if road else name

"""Many copies of a ramp side by side in one net, so that one SUMO steps a batch of encounters."""

import hashlib
from copy import deepcopy
from pathlib import Path

import sumolib
from lxml import etree

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import cache_folder, from_cache, shipped, without_comma
from merge_cosim.core.programs import run_program
from merge_cosim.core.xml_file import read_xml
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.xml import write_xml

SPACING = 30.0
"""Free room between two tiles [m], for the eye only: tiles share no node."""

READING = 60.0
"""Longest time for SUMO to read a net [s]."""

_REFERENCES = ("id", "from", "to", "incLanes")
"""Attributes that hold one id or several, and so get the tile's prefix."""


def tile_id(tile: int, name: str) -> str:
    """Id of the copy of an edge, lane or junction in tile number `tile`."""
    return f"t{tile}.{name}"


def tile_net(ramp: Ramp, count: int, whole: bool = False) -> Path:
    """Return a net with `count` unconnected copies of a ramp, from the cache or newly made.

    Every id carries the prefix of `tile_id`. A copy holds only what an encounter can use, because SUMO's step costs
    twice as much on a six-lane road: the edges of the two paths, and on them no lane further left than the leftmost
    that a path uses. It has no internal links, so that a path's length is the sum of its edges' lengths, and no right
    of way.

    Args:
        ramp: The ramp to copy.
        count: Number of tiles, at least 1.
        whole: Keep all edges and lanes, and the right of way, for a scene with other traffic.

    Raises:
        UserError: The ramp's net is not whole, or SUMO cannot read it.
    """
    source = ramp.net.read_bytes()
    ingredients = source + repr((ramp.main, ramp.ramp, count, whole)).encode() + Path(__file__).read_bytes()
    key = hashlib.sha256(ingredients).hexdigest()[:16]
    target = cache_folder("tiles") / f"{ramp.name.replace(',', '_')}-{count}-{key}.net.xml"

    def make(file: Path) -> None:
        net = read_xml(ramp.net, blanks=False)
        try:
            _leave_out_internal(net)
            if not whole:
                _reduce(net, ramp)
            _multiply(net, count)
        except ValueError as error:
            raise UserError(f"{ramp.net}: not a whole SUMO net: {error}") from None
        write_xml(file, net)
        if shipped("sumo_nets") not in ramp.net.parents:
            _try(file, ramp.net)

    return from_cache(target, make)


def _try(net: Path, named: Path) -> None:
    """Have a SUMO of its own read a net: a net that it cannot bear would end this process without a word."""
    command = [sumolib.checkBinary("sumo"), "--net-file", without_comma(net), "--no-internal-links", "--end", "0"]
    done = run_program(command, READING, named)
    if done.returncode:
        lines = [line for line in done.stderr.decode(errors="replace").splitlines() if line.startswith("Error")]
        raise UserError(f"{named}: SUMO cannot read it: {' '.join(lines) or 'it ends by signal'}")


def _leave_out_internal(net: etree._Element) -> None:
    """Take out of a net the lanes inside junctions."""
    for kind in ("edge", "junction", "connection"):
        for part in net.findall(kind):
            if (part.get("id") or part.get("from") or "").startswith(":"):  # so SUMO calls what lies in a junction
                net.remove(part)
    for node in net.findall("junction"):
        node.set("intLanes", "")
    for link in net.findall("connection"):
        link.attrib.pop("via", "")


def _reduce(net: etree._Element, ramp: Ramp) -> None:
    """Take out of a net what no car of an encounter uses."""
    leftmost: dict[str, int] = {}
    for section in ramp.main + ramp.ramp:
        leftmost[section.edge] = max(section.lane, leftmost.get(section.edge, 0))
    lanes, nodes = set(), set()
    for edge in net.findall("edge"):
        last = leftmost.get(edge.get("id", ""))
        if last is None:
            net.remove(edge)
            continue
        nodes |= {edge.get("from"), edge.get("to")}
        for number, lane in enumerate(edge.findall("lane")):
            if int(lane.get("index", "")) != number:
                raise ValueError(f"the lanes of edge '{edge.get('id')}' are not numbered 0, 1, ...")
            if number > last:
                edge.remove(lane)
                continue
            lanes.add(lane.get("id"))
    for node in net.findall("junction"):
        if node.get("id") not in nodes:
            net.remove(node)
            continue
        node.set("incLanes", " ".join(lane for lane in node.get("incLanes", "").split() if lane in lanes))
        if node.get("type") != "dead_end":
            node.set("type", "unregulated")
        for request in node.findall("request"):
            node.remove(request)
    for link in net.findall("connection"):
        ends = {f"{link.get('from')}_{link.get('fromLane')}", f"{link.get('to')}_{link.get('toLane')}"}
        if not ends <= lanes:
            net.remove(link)


def _multiply(net: etree._Element, count: int) -> None:
    """Put `count` copies of a net's content in its place, side by side."""
    location = net.find("location")
    if location is None:
        raise ValueError("it has no <location>")
    west, south, east, north = map(float, location.get("convBoundary", "").split(","))
    pitch = north - south + SPACING
    location.set("convBoundary", f"{west:.2f},{south:.2f},{east:.2f},{north + (count - 1) * pitch:.2f}")
    parts = [element for element in net if element is not location]
    for element in parts:
        net.remove(element)
    for tag in ("edge", "junction", "connection"):
        like = [element for element in parts if element.tag == tag]
        net.extend(_shifted(deepcopy(element), tile, tile * pitch) for tile in range(count) for element in like)


def _shifted(element: etree._Element, tile: int, offset: float) -> etree._Element:
    """Give an element and its children a tile's prefix and move them by `offset` [m] in y."""
    for part in element.iter():
        for name in _REFERENCES:
            if words := part.get(name):
                part.set(name, " ".join(tile_id(tile, word) for word in words.split()))
        if shape := part.get("shape"):
            points = (point.split(",") for point in shape.split())
            part.set("shape", " ".join(",".join([x, f"{float(y) + offset:.2f}", *z]) for x, y, *z in points))
        if y := part.get("y"):
            part.set("y", f"{float(y) + offset:.2f}")
    return element

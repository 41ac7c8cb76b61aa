"""Start a new ramp from an extract of OpenStreetMap: netconvert makes a net of it, by SUMO's own rules."""

from __future__ import annotations

import gzip
import math
import re
import tempfile
from pathlib import Path

import sumo
import sumolib
from lxml import etree

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.build import netconvert
from merge_cosim.ramps.check import COMFORTABLE_BRAKING
from merge_cosim.ramps.create.folder import require_new
from merge_cosim.ramps.create.from_net import ramp_from_net
from merge_cosim.ramps.create.new import RampNumbers
from merge_cosim.ramps.create.onramp import Origin, choose, read_source, source_root
from merge_cosim.ramps.infer import links_by_side

KEPT = ("highway.motorway", "highway.motorway_link", "highway.trunk", "highway.trunk_link")
"""Kinds of roads that are read from the extract."""
GUESSED = "AddedOnRampEdge"
"""End of the ids of edges on which netconvert has guessed an acceleration lane."""
NONE = re.compile(rb"""v=["']none["']""")
"""The value `none` of a tag, such as of a speed limit."""
ADVISORY = "130"
"""Germany's advisory speed on motorways without a limit [km/h]."""
WAY = re.compile(r"^-|[#-].*$")
"""What netconvert adds to a way's number in an edge's id."""
OPTIONS = (
    *("--keep-edges.by-type", ",".join(KEPT)),
    "--proj.utm",
    "--geometry.remove",
    "--ramps.guess",
    "--roundabouts.guess",
    "--junctions.join",
    "--osm.annotate-defaults",
    "--output.street-names",
    "--no-turnarounds",
    *("--xml-validation", "never"),
)
"""Options of netconvert. An acceleration lane is guessed only where the extract has none. OpenStreetMap has no schema;
to read SUMO's takes a quarter of the time."""


def ramp_from_osm(
    folder: Path,
    extract: Path,
    link: str | None = None,
    speed_limit: float | None = None,
    upstream: float = RampNumbers.upstream,
    downstream: float = RampNumbers.downstream,
    left_hand: bool | None = None,
) -> Path:
    """Write the stretch around one on-ramp of an extract into a new folder, and build it.

    Args:
        folder: Where to; its name is the ramp's.
        extract: OSM XML (`.osm`, `.osm.xml`, either also as `.gz`).
        link: An edge of the on-ramp, as netconvert names it (the way's number); may be left out if there is only one.
        speed_limit: Speed limit of the main road [m/s]; the extract's `maxspeed` if not given.
        upstream: Main road and on-ramp before the gore [m]; what the extract lacks is added straight on.
        downstream: Road after the gore [m]; likewise.
        left_hand: Whether traffic keeps left; if not given, it does where most links lie on the left of their roads.

    Raises:
        UserError: The file is no OSM XML, or `ramp_from_net` finds no ramp in it.
    """
    require_new(folder)
    root = source_root(extract)
    if root.tag != "osm":
        raise UserError(f"{extract}: its root is <{root.tag}>, not <osm>; a SUMO net goes with --from-net")
    with tempfile.TemporaryDirectory() as scratch:
        net_file, origin = read_extract(extract, Path(scratch), link, speed_limit, left_hand)
        return ramp_from_net(folder, net_file, link, speed_limit, upstream, downstream, origin)


def read_extract(
    extract: Path, scratch: Path, link: str | None, speed_limit: float | None, left_hand: bool | None
) -> tuple[Path, Origin]:
    """Make a net of an extract in a scratch folder; an acceleration lane that is guessed suits the speed limit."""
    readable, advised = _with_advisory_speed(extract, scratch)
    net_file = scratch / "extract.net.xml"
    _convert(extract, readable, net_file, left_hand)
    net = read_source(net_file, extract)
    left, right = links_by_side(net)
    side = None
    if left_hand is None and left > right:
        side = f"Traffic keeps left: {left} of {left + right} links lie on the left of their roads."
        left_hand = True
        _convert(extract, readable, net_file, left_hand)
        net = read_source(net_file, extract)
    if length := _guessed_too_short(net, link, speed_limit):
        _convert(extract, readable, net_file, left_hand, "--ramps.ramp-length", str(length))
        net = read_source(net_file, extract)
    edges = net.getEdges()
    unlimited = [edge.getID() for edge in edges if "speed" in edge.getParam("osmDefaults", "").split()]
    at_advisory_speed = [edge.getID() for edge in edges if WAY.sub("", edge.getID()) in advised]
    return net_file, Origin(extract, GUESSED, unlimited, at_advisory_speed, side)


def _convert(extract: Path, readable: Path, net_file: Path, left_hand: bool | None, *more: str) -> None:
    """Make a net of an extract; netconvert reads `readable`; error lines name `extract`."""
    types = Path(sumo.SUMO_HOME) / "data" / "typemap" / "osmNetconvert.typ.xml"
    files = ("--osm-files", str(readable), "--type-files", str(types), "--output-file", str(net_file))
    try:
        netconvert(extract, *files, *OPTIONS, *(["--lefthand"] if left_hand else []), *more)
    except UserError as error:
        if str(error).endswith(("No nodes loaded.", "No edges loaded.")):
            raise UserError(f"{extract}: no motorway, no trunk road and no link to either in it") from None
        raise


def _with_advisory_speed(extract: Path, scratch: Path) -> tuple[Path, set[str]]:
    """An extract in which `maxspeed=none`, which netconvert does not know, is the advisory speed; also its ways."""
    content = gzip.decompress(extract.read_bytes()) if extract.suffix == ".gz" else extract.read_bytes()
    if b"maxspeed" not in content or not NONE.search(content):
        return extract, set()
    try:
        root = etree.fromstring(content, etree.XMLParser(huge_tree=True, resolve_entities=False))
    except etree.XMLSyntaxError as error:
        raise UserError(f"{extract}: not XML: {error}") from None
    ways = set[str]()
    for tag in root.iterfind("way/tag[@v='none']"):
        if tag.get("k", "").startswith("maxspeed") and (way := tag.getparent()) is not None:
            tag.set("v", ADVISORY)
            ways.add(way.get("id", ""))
    readable = scratch / "advised.osm"
    readable.write_bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8"))
    return readable, ways


def _guessed_too_short(net: sumolib.net.Net, link: str | None, speed_limit: float | None) -> int:
    """How long a guessed acceleration lane must be [m] for comfortable braking after the merging point; 0: it is."""
    try:
        _, path = choose(net, link, RampNumbers.upstream, RampNumbers.downstream)
    except UserError:
        return 0  # ramp_from_net prints the error
    if not path.beside or GUESSED not in path.beside[0].getEdge().getID():
        return 0
    limit = speed_limit or float(path.main[path.before].getSpeed())
    needed = limit**2 / (2.0 * COMFORTABLE_BRAKING) / 0.8  # the merging point is a fifth of the lane after the gore
    return math.ceil(needed / 10.0) * 10 if needed > sum(lane.getLength() for lane in path.beside) else 0

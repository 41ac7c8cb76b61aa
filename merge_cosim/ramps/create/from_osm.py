"""Start a new ramp from an extract of OpenStreetMap: netconvert makes a net of it, by SUMO's own rules."""

from __future__ import annotations

import tempfile
from pathlib import Path

import sumo
import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.build import netconvert
from merge_cosim.ramps.create.folder import require_new
from merge_cosim.ramps.create.from_net import ramp_from_net
from merge_cosim.ramps.create.new import RampNumbers
from merge_cosim.ramps.create.onramp import Origin, root_element

KEPT = ("highway.motorway", "highway.motorway_link", "highway.trunk", "highway.trunk_link")
"""Kinds of roads that are read from the extract."""
GUESSED = "AddedOnRampEdge"
"""End of the ids of edges on which netconvert has guessed an acceleration lane."""
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
)
"""Options of netconvert. An acceleration lane is guessed only where the extract has none."""


def ramp_from_osm(
    folder: Path,
    extract: Path,
    link: str | None = None,
    speed_limit: float | None = None,
    upstream: float = RampNumbers.upstream,
    downstream: float = RampNumbers.downstream,
) -> Path:
    """Write the stretch around one on-ramp of an extract into a new folder, and build it.

    Args:
        folder: Where to; its name is the ramp's.
        extract: OSM XML (`.osm`, `.osm.xml`, either also as `.gz`).
        link: An edge of the on-ramp, as netconvert names it (the way's number); may be left out if there is only one.
        speed_limit: Speed limit of the main road [m/s]; the extract's `maxspeed` if not given.
        upstream: Main road and on-ramp before the gore [m]; what the extract lacks is added straight on.
        downstream: Road after the gore [m]; likewise.

    Raises:
        UserError: The file is no OSM XML, or `ramp_from_net` finds no ramp in it.
    """
    require_new(folder)
    root = root_element(extract)
    if root.tag != "osm":
        raise UserError(f"{extract}: its root is <{root.tag}>, not <osm>; a SUMO net goes with --from-net")
    with tempfile.TemporaryDirectory() as scratch:
        net_file = Path(scratch) / "extract.net.xml"
        types = Path(sumo.SUMO_HOME) / "data" / "typemap" / "osmNetconvert.typ.xml"
        files = ("--osm-files", str(extract), "--type-files", str(types), "--output-file", str(net_file))
        try:
            netconvert(extract, *files, *OPTIONS)
        except UserError as error:
            if str(error).endswith(("No nodes loaded.", "No edges loaded.")):
                raise UserError(f"{extract}: no motorway, no trunk road and no link to either in it") from None
            raise
        net = sumolib.net.readNet(str(net_file))
        unlimited = [edge.getID() for edge in net.getEdges() if "speed" in edge.getParam("osmDefaults", "").split()]
        origin = Origin(extract, GUESSED, unlimited)
        return ramp_from_net(folder, net_file, link, speed_limit, upstream, downstream, origin)

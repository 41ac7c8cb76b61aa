"""Start a new ramp from a SUMO net: the stretch around one on-ramp, to be edited and rebuilt."""

from __future__ import annotations

from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.check import STAND_INS
from merge_cosim.ramps.create.folder import require_new, write_ramp
from merge_cosim.ramps.create.layout import Layout, lay_out
from merge_cosim.ramps.create.new import RampNumbers, default_merging_point
from merge_cosim.ramps.create.onramp import Origin, choose, limit_of, read_source, sources_of, title_of
from merge_cosim.ramps.create.plain import PlainXml
from merge_cosim.ramps.definition import Extensions, RampFile
from merge_cosim.ramps.infer import Course, Joint
from merge_cosim.ramps.paths import keeps_left

MIN_AFTER = 100.0
"""Road kept beyond the acceleration lane's end, at least [m]."""


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
        UserError: The file is no net, or has no on-ramp, or several and `link` is not given, or no speed limit.
    """
    require_new(folder)
    origin = origin or Origin(net_file)
    net = read_source(net_file, origin.file)
    try:
        joint, path = choose(net, link, upstream, downstream)
    except UserError as error:
        raise UserError(f"{origin.file}: {error}") from None
    after = sum(lane.getLength() for lane in path.beside) + MIN_AFTER
    if after > downstream:
        raise UserError(f"{origin.file}: the acceleration lane is too long for the road; give --downstream {after:.0f}")
    layout = lay_out(path, upstream, downstream)
    limit = limit_of(layout.main[layout.gore].lane, speed_limit, origin.file)
    if speed_limit is None and (stand_in := STAND_INS.get(round(limit, 2))):
        road = layout.main[layout.gore].edge.getID()
        raise UserError(
            f"{origin.file}: no speed limit for '{road}': {limit:.2f} m/s is {stand_in}; give one with --speed-limit"
        )
    for lane in (lane for road in layout.roads for lane in road.edge.getLanes()):
        if lane.getWidth() <= 0.0:
            raise UserError(f"{origin.file}: lane {lane.getID()} is {lane.getWidth():g} m wide; mend its 'width'")
    left = any(keeps_left(road.edge) for road in layout.roads)
    plain = PlainXml(net, path, layout, limit, raised=speed_limit is None)
    definition = _definition(folder.name, joint, path, layout, limit, origin, given=speed_limit is not None)
    return write_ramp(folder, plain.nodes(), plain.edges(), plain.connections(), definition, path.reasons, left)


def _definition(
    name: str, joint: Joint, path: Course, layout: Layout, limit: float, origin: Origin, given: bool
) -> RampFile:
    """Contents of `ramp.toml`, with the source of each fact."""
    beside = [lane.getEdge().getID() for lane in path.beside]
    length = sum(road.length for road in layout.main if road.edge.getID() in beside)
    gore = layout.main[layout.gore]
    file = origin.file.name
    sources = {
        "geometry": f"{file}: its lanes, from node to node; the host's lane is kept, the others lie beside it.",
        **sources_of(joint, path, length, limit, origin, "merge-cosim ramp new" if given else None),
    }
    slower = [road for road in layout.main if road.lane.getSpeed() < limit - 0.005] if not given else []
    if slower:
        named = ", ".join(f"{road.edge.getID()} ({road.lane.getSpeed():g} m/s)" for road in slower)
        sources["speed_limit"] += f" Slower stretches of the road have it, too: {named}."
    if layout.surveyed:
        sources["extensions"] = f"{file} ends there; straight road was added."
    return RampFile(
        title=title_of(joint, name),
        net=f"{name}.net.xml",
        main=[road.edge.getID() for road in layout.main],
        host_lane=[road.lane.getIndex() for road in layout.main],
        ramp=[road.edge.getID() for road in layout.ramp] + beside,
        merging_lane=[road.lane.getIndex() for road in layout.ramp] + [lane.getIndex() for lane in path.beside],
        gore=gore.edge.getID(),
        merging_point=default_merging_point(length, limit),
        speed_limit=round(limit, 2),
        lengths={road.edge.getID(): road.length for road in layout.roads},
        extensions=Extensions(**layout.surveyed),
        sources=sources,
    )

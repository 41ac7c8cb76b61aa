"""Describe the on-ramp of a user's net in a `ramp.toml` beside it; the net stays as it is."""

from __future__ import annotations

from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.create.folder import definition_text, require_checked
from merge_cosim.ramps.create.new import RampNumbers, default_merging_point
from merge_cosim.ramps.create.onramp import Origin, choose, limit_of, read_source, sources_of, title_of
from merge_cosim.ramps.definition import FILE_NAME, RampFile
from merge_cosim.ramps.picture import draw


def describe_ramp(net_file: Path, link: str | None = None, speed_limit: float | None = None) -> Path:
    """Write a `ramp.toml` and a picture beside a net, which name the net's own edges; returns the folder.

    Args:
        net_file: The SUMO net (`.net.xml` or `.net.xml.gz`).
        link: An edge of the on-ramp; it may be left out where the net has one on-ramp only.
        speed_limit: Speed limit of the main road [m/s]; that of the host's lane after the gore if not given.

    Raises:
        UserError: A `ramp.toml` is there already; the file is no net, or has no on-ramp, or several and `link` is not
            given; or the ramp would not pass `ramp check`.
    """
    folder, origin = net_file.parent, Origin(net_file)
    target = folder / FILE_NAME
    net = read_source(net_file, net_file)
    if target.exists():
        raise UserError(f"{target}: exists already; remove it first, or copy the net to another folder")
    try:
        joint, path = choose(net, link, RampNumbers.upstream, RampNumbers.downstream)
    except UserError as error:
        raise UserError(f"{net_file}: {error}") from None
    length = sum(float(lane.getLength()) for lane in path.beside)
    given = None if speed_limit is None else "merge-cosim ramp describe"
    limit = limit_of(path.main[path.before], speed_limit, net_file)
    merging = (*path.ramp, *path.beside)
    definition = RampFile(
        title=title_of(joint, folder.resolve().name),
        net=net_file.name,
        described=True,
        main=[lane.getEdge().getID() for lane in path.main],
        host_lane=[lane.getIndex() for lane in path.main],
        ramp=[lane.getEdge().getID() for lane in merging],
        merging_lane=[lane.getIndex() for lane in merging],
        gore=joint.gore.getID(),
        merging_point=default_merging_point(length, limit),
        speed_limit=round(limit, 2),
        sources=sources_of(joint, path, length, limit, origin, given),
    )
    try:
        target.write_text(definition_text(definition, path.reasons), encoding="utf-8")
    except OSError as error:
        raise UserError(f"{target}: cannot be written ({error.strerror})") from None
    try:
        require_checked(folder, net_file)
    except UserError:
        target.unlink()
        raise
    draw(folder)
    return folder

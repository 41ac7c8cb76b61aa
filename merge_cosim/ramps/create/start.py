"""Start a new ramp from whichever source the user has."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.create.from_net import ramp_from_net
from merge_cosim.ramps.create.from_osm import ramp_from_osm
from merge_cosim.ramps.create.new import RampNumbers, new_ramp
from merge_cosim.ramps.definition import FILE_NAME, read_ramp_file

FOR_FILES = ("upstream", "downstream", "speed_limit", "left_hand")
"""Numbers that may be given beside a file."""
_SIDE = "ramp new: --left-hand and --right-hand are for --from-osm"


def start_ramp(
    folder: Path, numbers: Mapping[str, Any], net: Path | None, extract: Path | None, link: str | None
) -> tuple[Path, list[str]]:
    """Write a ramp into a new folder, which names it; also what was found in the file it was made from, a line each.

    It is made of the fields of `RampNumbers` that are given, or taken from a SUMO net or an extract of OpenStreetMap,
    of which `link` is an edge of the on-ramp.

    Raises:
        UserError: The arguments contradict each other, or the ramp cannot be made.
    """
    if net is not None and extract is not None:
        raise UserError("ramp new: give --from-net or --from-osm, not both")
    if net is None and extract is None:
        if link is not None:
            raise UserError("ramp new: --link names an edge of a file; give --from-net or --from-osm, too")
        if "left_hand" in numbers:
            raise UserError(f"{_SIDE}; mirror a straight ramp to see it from the left")
        return new_ramp(folder, RampNumbers(**numbers)), []
    for key in numbers:
        if key == "left_hand" and net is not None:
            raise UserError(f"{_SIDE}; a SUMO net says itself on which side it drives")
        if key not in FOR_FILES:
            raise UserError(f"ramp new: --{key.replace('_', '-')} comes from the file; leave it out")
    if net is not None:
        ramp_from_net(folder, net, link, **numbers)
    elif extract is not None:
        ramp_from_osm(folder, extract, link, **numbers)
    return folder, found(folder)


def found(folder: Path) -> list[str]:
    """What a ramp's `ramp.toml` names, and where it comes from, a line each."""
    file = read_ramp_file(folder)
    text = (folder / FILE_NAME).read_text(encoding="utf-8")
    return [
        f"main road: {' '.join(file.main)}, host's lanes {' '.join(map(str, file.host_lane))}",
        f"on-ramp: {' '.join(file.ramp)}, merging lanes {' '.join(map(str, file.merging_lane))}",
        *(line.removeprefix("# ") for line in text.splitlines() if line.startswith("# ")),
        *(f"{key}: {source}" for key, source in file.sources.items()),
    ]

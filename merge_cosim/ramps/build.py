"""Build a ramp's net from its plain XML, and say what is wrong with a ramp."""

import re
import subprocess
import tempfile
from itertools import pairwise
from math import dist
from pathlib import Path

import sumolib

from merge_cosim.errors import UserError
from merge_cosim.ramps.definition import FILE_NAME, RampFile, read_ramp_file
from merge_cosim.ramps.ramp import Ramp, missing_lanes, read_net

MIN_UPSTREAM = 400.0
"""Least reach upstream of the gore [m]: 13 s at the speed limit."""
MIN_DOWNSTREAM = 1400.0
"""Least reach downstream of the merging point [m]: 40 s at the speed limit and a start ahead of it."""
HARD_BRAKING = 8.0
"""A car at the speed limit must come to a stand before the auxiliary lane's end with this deceleration [m/s^2]."""
LENGTH_TOLERANCE = 0.01
"""How far a built length may be off the intended one [m]; netconvert writes centimetres."""
DRAWN_TOLERANCE = 3.0
"""How far a drawn lane may be off its length [m]; a junction of 2 m at either end takes 1 m each."""

_HEADER = re.compile(rb"\A(<\?xml[^>]*\?>)\s*<!--.*?-->\s*", re.DOTALL)


def build(folder: Path) -> Path:
    """Run netconvert on a ramp's `.netccfg` and return the net, the same bytes for the same sources.

    Raises:
        UserError: There is not exactly one `.netccfg`, or netconvert refuses the sources.
    """
    target = folder / read_ramp_file(folder).net
    settings = config(folder)
    with tempfile.TemporaryDirectory() as scratch:
        built = Path(scratch) / target.name
        command = [sumolib.checkBinary("netconvert"), "--configuration-file", str(settings)]
        done = subprocess.run([*command, "--output-file", str(built)], capture_output=True, text=True, check=False)
        if done.returncode or not built.is_file():
            lines = [line for line in done.stderr.splitlines() if line.startswith("Error")] or done.stderr.splitlines()
            raise UserError(f"{settings}: netconvert refuses it: {lines[0] if lines else 'no reason given'}")
        net = built.read_bytes()
    try:
        # The head names date, version and command, none of which belongs to the net.
        target.write_bytes(_HEADER.sub(rb"\1\n\n", net))
    except OSError as error:
        raise UserError(f"{target}: cannot be written ({error.strerror})") from None
    return target


def config(folder: Path) -> Path:
    """The one netconvert configuration in a folder."""
    found = sorted(folder.glob("*.netccfg"))
    if len(found) != 1:
        raise UserError(f"{folder}: {len(found)} files *.netccfg; a ramp that can be built has exactly one")
    return found[0]


def check(folder: Path) -> list[str]:
    """Every problem of a ramp, one line each; an empty list if there is none."""
    try:
        file = read_ramp_file(folder)
        net = read_net(folder / file.net)
    except UserError as error:
        return [str(error)]
    problems = missing_lanes(net, file)
    if not problems:
        problems = _connections(net, file) + _speeds(net, file) + _reach(Ramp.from_file(folder, file))
    problems += _lengths(net, file) + _mapping(net, file)
    return [f"{folder / FILE_NAME}: {problem}" for problem in problems]


def _connections(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Lanes along a path that no connection joins, and an auxiliary lane that is not beside the host's."""
    main = dict(zip(file.main, file.host_lane, strict=True))
    paths = [list(main.items()), list(zip(file.ramp, file.merging_lane, strict=True))]
    shared = [(edge, lane) for edge, lane in paths[1] if edge in main]
    if not shared:
        paths[1].append((file.gore, main[file.gore]))
    problems = []
    for path in paths:
        for (edge, lane), (onward, onward_lane) in pairwise(path):
            links = net.getEdge(edge).getLane(lane).getOutgoing()
            if not any(link.getToLane().getID() == f"{onward}_{onward_lane}" for link in links):
                problems.append(f"main/ramp: no connection in the net from {edge}_{lane} to {onward}_{onward_lane}")
    for edge, lane in shared:
        if abs(lane - main[edge]) != 1:
            problems.append(f"merging_lane: lane {lane} of '{edge}' is not beside the host's lane {main[edge]}")
    return problems


def _speeds(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Lanes of a path that are slower than the speed limit."""
    lanes = [net.getEdge(edge).getLane(lane) for edge, lane in _places(file)]
    return [
        f"speed_limit: lane {lane.getID()} allows {lane.getSpeed():g} m/s, less than {file.speed_limit:g} m/s"
        for lane in lanes
        if lane.getSpeed() < file.speed_limit
    ]


def _reach(ramp: Ramp) -> list[str]:
    """Paths that are too short for a run."""
    problems = []
    if ramp.upstream < MIN_UPSTREAM:
        problems.append(f"main/ramp: {ramp.upstream:.0f} m upstream of the gore, less than {MIN_UPSTREAM:.0f} m")
    beyond = ramp.downstream - ramp.merging_point
    if beyond < MIN_DOWNSTREAM:
        problems.append(f"main: {beyond:.0f} m after the merging point, less than {MIN_DOWNSTREAM:.0f} m")
    left = ramp.auxiliary_end - ramp.merging_point
    needed = ramp.speed_limit**2 / (2.0 * HARD_BRAKING)
    if left < needed:
        problems.append(f"merging_point: {left:.0f} m of auxiliary lane after it, but {needed:.0f} m to brake in")
    return problems


def _lengths(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Edges whose length, or whose drawing, is not what was intended: netconvert can swallow and stretch lanes."""
    problems = []
    for edge_id, intended in file.lengths.items():
        if not net.hasEdge(edge_id):
            problems.append(f"lengths.{edge_id}: the net {file.net} has no such edge")
            continue
        edge = net.getEdge(edge_id)
        if abs(edge.getLength() - intended) > LENGTH_TOLERANCE:
            problems.append(f"lengths.{edge_id}: built {edge.getLength():.2f} m long, intended {intended:.2f} m")
        shape = edge.getLane(edge.getLaneNumber() // 2).getShape()
        drawn = sum(dist(a, b) for a, b in pairwise(shape))
        if abs(drawn - intended) > DRAWN_TOLERANCE:
            problems.append(f"lengths.{edge_id}: drawn {drawn:.1f} m long, intended {intended:.1f} m; mend the shapes")
    missing = [edge for edge in dict(_places(file)) if edge not in file.lengths]
    return problems + [f"lengths.{edge}: missing; give the intended length" for edge in missing]


def _mapping(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Lanes that the NGSIM mapping names and the net lacks."""
    known = {lane.getID() for edge in net.getEdges() for lane in edge.getLanes()}
    named = file.ngsim.lanes if file.ngsim else {}
    return [
        f"ngsim.lanes.{number}: the net {file.net} has no lane '{lane}'"
        for number, lanes in named.items()
        for lane in lanes
        if lane not in known
    ]


def _places(file: RampFile) -> list[tuple[str, int]]:
    """Edge and lane of every section of both paths."""
    main = list(zip(file.main, file.host_lane, strict=True))
    return main + list(zip(file.ramp, file.merging_lane, strict=True))

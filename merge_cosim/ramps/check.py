"""Problems of a ramp: one line for each, with the file, what is wrong and how to mend it."""

from __future__ import annotations

import hashlib
from itertools import pairwise
from pathlib import Path
from typing import Any

import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import cache_folder
from merge_cosim.ramps.build import PLAIN, built, config
from merge_cosim.ramps.definition import FILE_NAME, RampFile, read_ramp_file
from merge_cosim.ramps.paths import MAX_TURN, turn
from merge_cosim.ramps.ramp import Ramp, missing_lanes, read_net

MIN_UPSTREAM = 400.0
"""Least reach upstream of the gore [m]: 13 s at the speed limit."""
MIN_DOWNSTREAM = 1400.0
"""Least reach downstream of the merging point [m]: 40 s at the speed limit and a start ahead of it."""
HARD_BRAKING = 8.0
"""A car at the speed limit must come to a stand before the auxiliary lane's end with this deceleration [m/s^2]."""
COMFORTABLE_BRAKING = 3.4
"""It should do so with this one [m/s^2], which most drivers find comfortable (AASHTO's Green Book, stopping sight
distance)."""
LENGTH_TOLERANCE = 0.01
"""How far a built length may be off the intended one [m]; netconvert writes centimetres."""
DRAWN_TOLERANCE = 3.0
"""How far a drawn edge may be off its length [m]; a junction of 2 m at either end takes 1 m each."""
SPEED_TOLERANCE = 0.005
"""netconvert writes speeds to the centimetre per second [m/s]."""
LANE_WIDTHS = (2.5, 6.0)
"""Lanes of freeways and on-ramps are of these widths [m]."""
STAND_INS = {
    39.44: "SUMO's default for motorways of OpenStreetMap",
    44.44: "the default of older versions of SUMO for motorways of OpenStreetMap",
}
"""Speeds [m/s] that netconvert sets for motorways where no speed is given, and that no road sign shows."""


def check(folder: Path, just_built: bool = False) -> list[str]:
    """Every problem of a ramp, a line each; none: it is sound. A net `just_built` is not compared with its sources."""
    try:
        file = read_ramp_file(folder)
        net = read_net(folder / file.net)
    except UserError as error:
        return [str(error)]
    own = missing_lanes(net, file)
    if not own:
        ramp = Ramp.from_file(folder, file)
        own = _order(net, file) + _connections(net, file) + _lanes(net, file)
        own += _merging_point(ramp) + _lane_end(net, file)
        own += [] if file.described else _of_encounters(net, file, ramp)
    own += [] if file.described else _lengths(net, file)
    own += _extensions(file) + _mapping(net, file)
    return [f"{folder / FILE_NAME}: {problem}" for problem in own] + ([] if just_built else _sources(folder, file))


def refuse_unsound(folder: Path) -> None:
    """Refuse a ramp that does not pass `check`; a ramp that passes is remembered in the cache until its files change.

    Raises:
        UserError: It does not pass; the line names the first problem.
    """
    named = folder / FILE_NAME, folder / read_ramp_file(folder).net, folder / "site.toml", Path(__file__)
    plain = [file for kind in PLAIN for file in folder.glob(f"*.{kind}.xml")]
    held = hashlib.sha256()
    for file in filter(Path.is_file, (*named, *sorted(plain), *sorted(folder.glob("*.netccfg")))):
        held.update(f"{file.name} {hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    sound = cache_folder("checks") / held.hexdigest()[:16]
    if sound.is_file():
        return
    if problems := check(folder):
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise UserError(
            f"{problems[0]}{more}: see merge-cosim ramp check {folder}; --unchecked-ramp runs it all the same"
        )
    sound.touch()


def _of_encounters(net: sumolib.net.Net, file: RampFile, ramp: Ramp) -> list[str]:
    """Problems for encounters; for a described net, which is for living traffic, they are notes."""
    return _speeds(net, file) + _reach(ramp) + _lights(net, file)


def notes(folder: Path) -> list[str]:
    """Notes on a ramp that are no problems, one line each; none for a ramp that cannot be read."""
    try:
        file = read_ramp_file(folder)
        net = read_net(folder / file.net)
        ramp = Ramp.from_file(folder, file)
    except UserError:
        return []
    found = _of_encounters(net, file, ramp) if file.described else []
    if net._location.get("projParameter", "!") == "!":
        found.append(f"{file.net}: no georeference: no map can be put behind it (<location> in the .nod.xml gives one)")
    if not file.described and not list(folder.glob("*.netccfg")):
        found.append("no *.netccfg: the ramp can be used, but neither edited nor rebuilt")
    gore = net.getEdge(file.gore).getFromNode()
    if not ramp.changes_lane and gore.getType() == "unregulated":
        found.append(
            f"gore: at node '{gore.getID()}' of type 'unregulated' SUMO's own drivers do not see each other; "
            "that is no matter to encounters, but others collide: make its type 'zipper' in the .nod.xml"
        )
    left = ramp.auxiliary_end - ramp.merging_point
    needed = ramp.speed_limit**2 / (2.0 * COMFORTABLE_BRAKING)
    if ramp.speed_limit**2 / (2.0 * HARD_BRAKING) <= left < needed:
        found.append(
            f"merging_point: {left:.0f} m of auxiliary lane after it; braking comfortably "
            f"({COMFORTABLE_BRAKING} m/s^2) from {ramp.speed_limit:g} m/s takes {needed:.0f} m"
        )
    return [f"{folder / FILE_NAME}: note: {line}" for line in found]


def _order(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Edges that do not follow one another, so that stations would jump or run backwards."""
    problems = []
    own = [edge for edge in file.ramp if edge not in file.main]
    for key, path in (("main", file.main), ("ramp", [*own, file.gore])):
        for name, onward in pairwise(path):
            edge, following = net.getEdge(name), net.getEdge(onward)
            if edge.getToNode() is not following.getFromNode():
                problems.append(
                    f"{key}: stations would jump: '{name}' ends at node '{edge.getToNode().getID()}', but '{onward}' "
                    f"begins at '{following.getFromNode().getID()}'; list the edges in driving order, all of them"
                )
            elif abs(turn(edge, following)) > MAX_TURN:
                problems.append(
                    f"{key}: stations would run backwards: '{onward}' turns back at the end of "
                    f"'{name}' ({abs(turn(edge, following)):.0f} degrees); mend the shapes, or swap 'from' and 'to'"
                )
    return problems


def _connections(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Lanes along a path that no connection joins, and an auxiliary lane that is not beside the host's."""
    main = dict(zip(file.main, file.host_lane, strict=True))
    merging = list(zip(file.ramp, file.merging_lane, strict=True))
    shared = [(edge, lane) for edge, lane in merging if edge in main]
    joins = [] if shared else [(file.gore, main[file.gore])]
    problems = []
    for key, path in (("host_lane", list(main.items())), ("merging_lane", merging + joins)):
        for (edge, lane), (onward, onward_lane) in pairwise(path):
            links = net.getEdge(edge).getLane(lane).getOutgoing()
            leads = sorted(link.getToLane().getID() for link in links)
            if f"{onward}_{onward_lane}" not in leads:
                problems.append(
                    f"{key}: no connection in the net from {edge}_{lane} to {onward}_{onward_lane} (it leads to "
                    f'{", ".join(leads) or "nothing"}); add <connection from="{edge}" fromLane="{lane}" to="{onward}" '
                    f'toLane="{onward_lane}"/> to the .con.xml, or name another lane'
                )
    for edge, lane in shared:
        if abs(lane - main[edge]) != 1:
            problems.append(f"merging_lane: lane {lane} of '{edge}' is not beside the host's lane {main[edge]}")
    return problems


def _speeds(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Lanes of the main road that are slower than the speed limit, and speeds that were not given."""
    problems = []
    for lane in (net.getEdge(edge).getLane(index) for edge, index in zip(file.main, file.host_lane, strict=True)):
        if lane.getSpeed() < file.speed_limit - SPEED_TOLERANCE:
            problems.append(
                f"speed_limit: lane {lane.getID()} allows {lane.getSpeed():g} m/s, less than {file.speed_limit:g} m/s; "
                "lower speed_limit, or raise the edge's speed in the .edg.xml"
            )
    unset: dict[float, list[str]] = {}
    for lane in _on_paths(net, file):
        if (speed := round(lane.getSpeed(), 2)) in STAND_INS:
            unset.setdefault(speed, []).append(lane.getID())
    problems += [
        f"speed_limit: no speed limit for {', '.join(lanes)}: {speed:.2f} m/s is {STAND_INS[speed]}; give the edges "
        "their own speed in the .edg.xml"
        for speed, lanes in unset.items()
    ]
    return problems


def _lanes(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Lanes of a path that are closed to passenger cars, or of a width that no lane has."""
    problems = []
    for lane in _on_paths(net, file):
        if not lane.allows("passenger"):
            problems.append(
                f"host_lane/merging_lane: lane {lane.getID()} is closed to passenger cars; mend 'allow' or 'disallow' "
                "in the .edg.xml, or name another lane"
            )
        if not LANE_WIDTHS[0] <= lane.getWidth() <= LANE_WIDTHS[1]:
            problems.append(
                f"host_lane/merging_lane: lane {lane.getID()} is {lane.getWidth():.2f} m wide, not {LANE_WIDTHS[0]:g} "
                f"to {LANE_WIDTHS[1]:g} m; mend 'width' in the .edg.xml"
            )
    return problems


def _reach(ramp: Ramp) -> list[str]:
    """Paths that are too short for a run."""
    problems = []
    if ramp.upstream < MIN_UPSTREAM:
        problems.append(
            f"main/ramp: {ramp.upstream:.0f} m upstream of the gore, less than {MIN_UPSTREAM:.0f} m; make both roads "
            "reach so far in the .edg.xml"
        )
    beyond = ramp.downstream - ramp.merging_point
    if beyond < MIN_DOWNSTREAM:
        problems.append(
            f"main: {beyond:.0f} m after the merging point, less than {MIN_DOWNSTREAM:.0f} m; make the last edge longer"
        )
    return problems


def _merging_point(ramp: Ramp) -> list[str]:
    """A merging point off the acceleration lane or too near its end."""
    problems = []
    left = ramp.auxiliary_end - ramp.merging_point
    needed = ramp.speed_limit**2 / (2.0 * HARD_BRAKING)
    if left < 0.0:
        problems.append(f"merging_point: {-left:.0f} m beyond the auxiliary lane's end, {ramp.auxiliary_end:.0f} m")
    elif left < needed:
        problems.append(
            f"merging_point: {left:.0f} m of auxiliary lane after it, but {needed:.0f} m to brake in (at "
            f"{HARD_BRAKING:g} m/s^2 from {ramp.speed_limit:g} m/s); move it upstream, or make the lane longer"
        )
    if not ramp.changes_lane and ramp.merging_point > 0.0:
        problems.append("merging_point: there is no auxiliary lane, so it must be 0.0, the gore")
    return problems


def _lane_end(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """An auxiliary lane that goes on beside the host's after the last edge that is listed for it."""
    last, index = file.ramp[-1], file.merging_lane[-1]
    if last not in file.main:
        return []
    after = file.main.index(last) + 1
    if after == len(file.main):
        return [f"ramp: the auxiliary lane goes on to the road's end: no car has to merge; end it before '{last}'"]
    onward, host = file.main[after], file.host_lane[after]
    links = net.getEdge(last).getLane(index).getOutgoing()
    further = [link.getToLane() for link in links if link.getToLane().getEdge().getID() == onward]
    return [
        f"ramp: the auxiliary lane goes on as {lane.getID()}: list '{onward}' in ramp and its lane in merging_lane"
        for lane in further
        if lane.getIndex() != host
    ]


def _lights(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Traffic lights on a path; in an encounter the cars ignore them."""
    met = [net.getEdge(edge).getToNode() for edge in dict.fromkeys(file.main + file.ramp)]
    return [
        f"main/ramp: node '{node.getID()}' has a traffic light, which an encounter's cars do not see; make its type "
        "'unregulated' in the .nod.xml"
        for node in dict.fromkeys(met)
        if node.getType().startswith("traffic_light")
    ]


def _lengths(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Edges whose length, or whose drawing, is not what was intended: netconvert can swallow and stretch lanes."""
    problems = []
    for edge_id, intended in file.lengths.items():
        if not net.hasEdge(edge_id):
            problems.append(f"lengths.{edge_id}: the net {file.net} has no such edge")
            continue
        edge = net.getEdge(edge_id)
        if abs(edge.getLength() - intended) > LENGTH_TOLERANCE:
            problems.append(
                f"lengths.{edge_id}: built {edge.getLength():.2f} m long, intended {intended:.2f} m; change "
                "it here, or 'length' in the .edg.xml"
            )
        lanes = edge.getLanes()
        # The middle of a bend is as long as its outermost lanes on average.
        drawn = sum(sumolib.geomhelper.polyLength(lane.getShape()) for lane in (lanes[0], lanes[-1])) / 2
        if abs(drawn - intended) > DRAWN_TOLERANCE:
            problems.append(f"lengths.{edge_id}: drawn {drawn:.1f} m long, intended {intended:.1f} m; mend the shapes")
    missing = [edge for edge in dict.fromkeys(file.main + file.ramp) if edge not in file.lengths]
    return problems + [f"lengths.{edge}: missing; give the intended length" for edge in missing]


def _extensions(file: RampFile) -> list[str]:
    """Places that cannot be where added road begins."""
    given = file.extensions
    return [
        f"extensions.{key}: {value:g} m past the gore, but it must be {'positive' if after else 'negative'}"
        for key, value, after in (
            ("main_before", given.main_before, False),
            ("ramp_before", given.ramp_before, False),
            ("main_after", given.main_after, True),
            ("exit_after", given.exit_after, True),
        )
        if value is not None and (value <= 0.0) == after
    ]


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


def _sources(folder: Path, file: RampFile) -> list[str]:
    """A net that is not what its plain XML builds."""
    if file.described or not list(folder.glob("*.netccfg")):
        return []
    try:
        fresh = built(config(folder))
    except UserError as error:
        return [str(error)]
    if fresh == (folder / file.net).read_bytes():
        return []
    return [f"{folder / file.net}: not what its plain XML builds now; build it with: merge-cosim ramp build {folder}"]


def _on_paths(net: sumolib.net.Net, file: RampFile) -> list[Any]:
    """Lanes of both paths."""
    main = list(zip(file.main, file.host_lane, strict=True))
    places = dict.fromkeys(main + list(zip(file.ramp, file.merging_lane, strict=True)))
    return [net.getEdge(edge).getLane(lane) for edge, lane in places]

"""Find the on-ramps in a SUMO net, and follow the two paths through one of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.paths import (
    CAR,
    MAX_TURN,
    OSM,
    Edge,
    Lane,
    follow,
    has_cars,
    is_link,
    keeps_left,
    lanes_into,
    rank,
    targets,
    turn,
)

ROADS = ("motorway", "trunk")
"""Ends of the types of roads that an on-ramp joins (`highway.motorway` and the like)."""
MAX_ANGLE = 45.0
"""An on-ramp joins at no more than this angle [degrees]; anything else is a crossing."""
ANGLE_TOLERANCE = 0.5
"""netconvert rounds coordinates to centimetres, and angles with them [degrees]."""
LOOK_BACK = 50.0
"""The angle at which an on-ramp joins is measured over its last part of this length, beside its last metre [m]."""


@dataclass(frozen=True)
class Joint:
    """A place where an on-ramp comes in.

    Attributes:
        link: The on-ramp's last edge.
        through: The main road's last edge before the gore.
        gore: The main road's first edge after it.
    """

    link: Edge
    through: Edge
    gore: Edge


@dataclass(frozen=True)
class Course:
    """The two paths through a net, each a tuple of lanes in driving order.

    Attributes:
        main: The host's lanes.
        before: How many of them lie before the gore.
        ramp: The merging car's lanes before the gore.
        beside: Its lanes beside the host's, from the gore to the end of the acceleration lane; empty where the ramp
            joins by a connection.
        exit: The lane that the acceleration lane leads to, if it is an exit lane.
        ending: How the acceleration lane ends, in words.
        reasons: Why the paths are these, in words, by key of `ramp.toml`.
    """

    main: tuple[Lane, ...]
    before: int
    ramp: tuple[Lane, ...]
    beside: tuple[Lane, ...]
    exit: Lane | None
    ending: str
    reasons: dict[str, str]


def joints(net: sumolib.net.Net) -> list[Joint]:
    """Every on-ramp of a net, in the order of its edges.

    A net with OpenStreetMap's types: a link that joins a motorway or trunk road, beside another edge. Any other net: an
    edge that joins a road of at least as many lanes and at least the same speed limit, one of them greater. Either must
    join at `MAX_ANGLE` or less and be open to cars.
    """
    typed = any(is_link(edge) or edge.getType().startswith(OSM) for edge in net.getEdges())
    found = []
    for gore in net.getEdges():
        through = _through(gore)
        if through is None or (typed and not any(edge.getType().endswith(ROADS) for edge in (through, gore))):
            continue
        if is_link(gore) or not has_cars(gore):
            continue
        joins = is_link if typed else _lesser_than(through)
        found += [Joint(edge, through, gore) for edge in _arriving(gore) if edge is not through and joins(edge)]
    return found


def joint_of(net: sumolib.net.Net, link: str) -> Joint:
    """Where the traffic of an edge joins the main road; it may be any edge of the on-ramp.

    The number of an OpenStreetMap way names all edges that netconvert has made of it.

    Raises:
        UserError: The net has no such edge, or following it leads to no joint.
    """
    if not net.hasEdge(link):
        parts = [edge.getID() for edge in net.getEdges() if edge.getID().startswith(f"{link}#")]
        if not parts:
            raise UserError(f"the net has no edge '{link}'")
        link = parts[0]
    known = {joint.link.getID(): joint for joint in joints(net)}
    ahead, seen, last = [net.getEdge(link)], {link}, net.getEdge(link)
    while ahead:
        last = ahead.pop(0)
        if last.getID() in known:
            return known[last.getID()]
        onward = [edge for edge in last.getOutgoing() if has_cars(edge) and edge.getID() not in seen]
        for gore in onward:
            if (joint := _joins(last, gore)) is not None:
                return joint
        # Along links, or along the only edge that there is.
        ahead += onward if len(onward) == 1 else [edge for edge in onward if is_link(edge)]
        seen.update(edge.getID() for edge in ahead)
    count = len(last.getOutgoing())
    raise UserError(f"edge '{link}' joins no road: it leads to {count} edges after '{last.getID()}'")


def links_by_side(net: sumolib.net.Net) -> tuple[int, int]:
    """How many links join or leave a main road on its left, and how many on its right; crossings do not count."""
    sides = [0, 0]
    for link in filter(is_link, net.getEdges()):
        pairs = [*((link, road) for road in link.getOutgoing()), *((road, link) for road in link.getIncoming())]
        for edge, onward in pairs:
            road = onward if edge is link else edge
            if road.getType().endswith(ROADS) and abs(angle := _deflection(edge, onward)) <= MAX_ANGLE:
                sides[angle <= 0.0] += 1  # also where a link comes in
    return sides[0], sides[1]


def course(joint: Joint, upstream: float, downstream: float) -> Course:
    """Follow both paths up to the given distances [m] from the gore, or to where the net ends.

    Raises:
        UserError: The lanes at the gore or the acceleration lane make no merge.
    """
    ramp_lane, gore_lane, host, why = _lanes_at_gore(joint)
    after = follow(host, downstream, avoid=_led_to_beside(gore_lane, host))
    gore_length = joint.gore.getLength()
    before = follow(
        host, upstream + gore_length, True, allowed=lambda e, on: on is not joint.gore or e is joint.through
    )
    back = follow(ramp_lane, upstream, True, allowed=_along_ramp(joint, (*before.lanes, *after.lanes)))
    main = (*before.lanes[:0:-1], *after.lanes)
    reasons = {"main": _why_main(joint, before.passed, after.passed, before.stop, after.stop), "host_lane": why}
    ramp, count = back.lanes[::-1], len(before.lanes) - 1
    if gore_lane is host:
        return Course(main, count, ramp, (), None, "", reasons)
    beside, exit_lane, ending = _beside(gore_lane, list(after.lanes))
    return Course(main, count, ramp, tuple(beside), exit_lane, ending, reasons)


def _why_main(joint: Joint, joining: tuple[Edge, ...], leaving: tuple[Edge, ...], begin: str, end: str) -> str:
    """Why the main road is this one, in words."""

    def named(edges: tuple[Edge, ...]) -> str:
        names = dict.fromkeys(f"'{edge.getID()}'" for edge in edges if edge is not joint.link)
        return ", ".join(names)

    parts = ["main: the same road by class, name, lanes and direction, open to cars"]
    parts += [f"it leaves aside {named(leaving)}"] if named(leaving) else []
    parts += [f"{named(joining)} come in before the gore"] if named(joining) else []
    parts += [f"upstream {begin}"] if begin else []
    parts += [f"downstream {end}"] if end else []
    return "; ".join(parts)


def _arriving(gore: Edge) -> list[Edge]:
    """Edges open to cars that lead to another at `MAX_ANGLE` or less."""
    return [edge for edge in gore.getIncoming() if has_cars(edge) and _angle(edge, gore) <= MAX_ANGLE + ANGLE_TOLERANCE]


def _through(gore: Edge) -> Edge | None:
    """The main road before an edge; no link."""
    roads = (edge for edge in _arriving(gore) if not is_link(edge))
    return max(roads, key=lambda edge: rank(edge, gore, edge), default=None)


def _joins(link: Edge, gore: Edge) -> Joint | None:
    """The joint of an edge that the user has named, where it joins a road of at least its own rank."""
    others = [edge for edge in gore.getIncoming() if edge is not link and has_cars(edge) and not is_link(edge)]
    through = max(others, key=lambda edge: rank(edge, gore, edge), default=None)
    if through is None or is_link(gore) or abs(turn(link, gore)) > MAX_TURN or abs(turn(through, gore)) > MAX_TURN:
        return None
    own, other = ((not is_link(each), each.getLaneNumber(), each.getSpeed()) for each in (link, through))
    return Joint(link, through, gore) if other >= own else None


def _angle(edge: Edge, onward: Edge) -> float:
    """At what angle an edge joins another [degrees]: that of its last metre, or of its last part if that is less."""
    angle = abs(turn(edge, onward))
    (x, y), *further = onward.getShape()[:2]
    far = next((p for p in reversed(edge.getShape()) if math.dist(p, edge.getShape()[-1]) >= LOOK_BACK), None)
    if far is None:
        return angle
    ahead = math.atan2(further[0][1] - y, further[0][0] - x)
    end = edge.getShape()[-1]
    part = math.degrees(math.remainder(ahead - math.atan2(end[1] - far[1], end[0] - far[0]), 2.0 * math.pi))
    return min(angle, abs(part))


def _deflection(edge: Edge, onward: Edge) -> float:
    """Change of direction from the last part of an edge to the first part of another [degrees], left positive."""
    (x, y), (end_x, end_y) = _last_part(edge.getShape())
    (far_x, far_y), (next_x, next_y) = _last_part(onward.getShape()[::-1])
    before, after = math.atan2(end_y - y, end_x - x), math.atan2(far_y - next_y, far_x - next_x)
    return math.degrees(math.remainder(after - before, 2.0 * math.pi))


def _last_part(shape: list[tuple[float, float]]) -> tuple[tuple[float, float], tuple[float, float]]:
    """The last point at least `LOOK_BACK` before a shape's end (else its first), and its end."""
    return next((p for p in reversed(shape) if math.dist(p, shape[-1]) >= LOOK_BACK), shape[0]), shape[-1]


def _lesser_than(through: Edge) -> Callable[[Edge], bool]:
    def joins(edge: Edge) -> bool:
        own, other = (edge.getLaneNumber(), edge.getSpeed()), (through.getLaneNumber(), through.getSpeed())
        return own != other and own[0] <= other[0] and own[1] <= other[1]

    return joins


def _onto(edge: Edge, onward: Edge, from_right: bool) -> dict[int, Lane]:
    """Lanes of `onward` that an edge leads to, by index, each with the lane that leads there.

    A lane that is connected to several is the one nearest to its own side of the road that none of its neighbours
    on that side leads to.
    """
    found: dict[int, Lane] = {}
    lanes = edge.getLanes() if from_right else edge.getLanes()[::-1]
    for lane in lanes:
        leads = {each.getIndex() for each in targets(lane) if each.getEdge() is onward} if lane.allows(CAR) else set()
        free = leads - set(found)
        if free or leads:
            found[(min if from_right else max)(free or leads)] = lane
    return dict(sorted(found.items()))


def _lanes_at_gore(joint: Joint) -> tuple[Lane, Lane, Lane, str]:
    """The on-ramp's lane that merges, the lane it leads to after the gore, the host's lane there, and why."""
    gore, main = joint.gore, f"'{joint.through.getID()}'"
    where = f"edge '{joint.link.getID()}'"
    from_right = _from_outside(joint)
    own, through = _onto(joint.link, gore, from_right), _onto(joint.through, gore, not from_right)
    if not own or not through:
        raise UserError(
            f"{where if not own else 'edge ' + main}: none of its lanes is open to cars and leads to {gore.getID()}"
        )
    shared = sorted(set(own) & set(through))
    if shared:
        # Of several shared lanes the one furthest into the road; of two on-ramp lanes the one that merges.
        lane = shared[-1] if min(own) <= min(through) else shared[0]
        why = f"host_lane: lane {lane} of '{gore.getID()}' is the one that the on-ramp's lane {own[lane].getID()} joins"
        return own[lane], gore.getLane(lane), gore.getLane(lane), why
    if not max(own) < min(through) and min(own) < max(through):
        raise UserError(f"{where} comes in between the lanes of {main}, neither right nor left of them")
    right = max(own) < min(through)
    lane = max(own) if right else min(own)
    host = lane + 1 if right else lane - 1
    if host not in through:
        raise UserError(f"{where}: no lane of {main} leads to the lane beside it, {gore.getID()}_{host}")
    beside = f"{gore.getID()}_{lane}"
    why = f"host_lane: lane {host} of '{gore.getID()}' is the main road's lane beside the acceleration lane {beside}"
    return own[lane], gore.getLane(lane), gore.getLane(host), why


def _from_outside(joint: Joint) -> bool:
    """Whether the on-ramp comes from the side of lane 0: the right, or the left where traffic keeps left.

    By the connections, or by the shapes where both edges lead to the same lanes.
    """
    indices = [
        sorted(link.getToLane().getIndex() for link in edge.getOutgoing().get(joint.gore, ()))
        for edge in (joint.link, joint.through)
    ]
    if all(indices) and (min(indices[0]), max(indices[0])) != (min(indices[1]), max(indices[1])):
        ((low, high), (through_low, through_high)) = ((found[0], found[-1]) for found in indices)
        if low < through_low or high > through_high:
            return bool(low < through_low)
    far, _ = _last_part(joint.link.getShape())
    (x, y), (end_x, end_y) = joint.through.getShape()[-2:]
    side = (end_x - x) * (far[1] - end_y) - (end_y - y) * (far[0] - end_x)
    return bool((side > 0.0) == keeps_left(joint.gore))


def _beside(lane: Lane, main: list[Lane]) -> tuple[list[Lane], Lane | None, str]:
    """Follow the on-ramp's lane beside the host's until it ends; also the exit lane it leads to, and how it ends."""
    beside = [lane]
    for onward in main[1:]:
        leads = targets(beside[-1])
        further = [each for each in leads if each.getEdge() is onward.getEdge() and each is not onward]
        if not further:
            out = next((each for each in leads if each.getEdge() is not onward.getEdge()), None)
            if out is not None:
                return beside, out, f"leads to the exit {out.getID()}"
            return beside, None, "joins the host's lane" if leads else "ends"
        if abs(further[0].getIndex() - onward.getIndex()) != 1:
            return beside, None, "is no longer beside the host's"
        beside.append(further[0])
    length = sum(each.getLength() for each in beside)
    raise UserError(
        f"the on-ramp's lane {lane.getID()} goes on beside the road for {length:.0f} m, as far as was looked or the "
        f"net reaches: no car has to merge; take a larger extract if it ends further on"
    )


def _led_to_beside(gore_lane: Lane, host: Lane) -> Callable[[Lane], bool]:
    """Whether the lane beside the host's, on the on-ramp's side, leads to a lane."""
    side = gore_lane.getIndex() - host.getIndex()

    def taken(lane: Lane) -> bool:
        before = lanes_into(lane)
        return any(
            lower is not upper
            and lower.getEdge() is upper.getEdge()
            and (lower.getIndex() - upper.getIndex()) * side > 0
            for lower in before
            for upper in before
        )

    return taken if side else lambda lane: False


def _along_ramp(joint: Joint, path: tuple[Lane, ...]) -> Callable[[Edge, Edge], bool]:
    """Whether an on-ramp goes from one edge to another: not over a crossing or the main road, nor beyond the links."""
    main = {lane.getEdge().getID() for lane in path}

    def allowed(edge: Edge, onward: Edge) -> bool:
        node = onward.getFromNode()
        if (len(node.getIncoming()) > 1 and len(node.getOutgoing()) > 1) or edge.getID() in main:
            return False
        return is_link(edge) or not is_link(joint.link)

    return allowed

"""Find the on-ramps in a SUMO net, and follow the two paths through one of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import sumolib

from merge_cosim.core.errors import UserError

Edge = Any
Lane = Any
"""sumolib's classes, which carry no types."""

ROADS = ("motorway", "trunk")
"""Ends of the types of roads that an on-ramp joins (`highway.motorway` and the like)."""
OSM = "highway."
"""How types of OpenStreetMap begin."""
LINK = "_link"
"""End of a link's type."""
MAX_ANGLE = 45.0
"""An on-ramp joins at less than this angle [degrees]; anything else is a crossing."""
MAX_TURN = 90.0
"""A road goes on at less than this angle [degrees]; anything else is another road, or the way back."""


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
    """

    main: tuple[Lane, ...]
    before: int
    ramp: tuple[Lane, ...]
    beside: tuple[Lane, ...]
    exit: Lane | None
    ending: str


def joints(net: sumolib.net.Net) -> list[Joint]:
    """Every on-ramp of a net, in the order of its edges.

    A net with OpenStreetMap's types: a link that joins a motorway or trunk road, beside another edge. Any other net: an
    edge that joins a road of at least as many lanes and at least the same speed limit, one of them greater. Either must
    join at an acute angle.
    """
    typed = any(is_link(edge) or edge.getType().startswith(OSM) for edge in net.getEdges())
    found = []
    for gore in net.getEdges():
        arriving = [edge for edge in gore.getIncoming() if abs(turn(edge, gore)) < MAX_ANGLE]
        through = max(
            (edge for edge in arriving if not is_link(edge)), key=lambda edge: _rank(edge, gore), default=None
        )
        if through is None or (typed and not any(edge.getType().endswith(ROADS) for edge in (through, gore))):
            continue
        if is_link(gore):
            continue
        joins = is_link if typed else _lesser_than(through)
        found += [Joint(edge, through, gore) for edge in arriving if edge is not through and joins(edge)]
    return found


def joint_of(net: sumolib.net.Net, link: str) -> Joint:
    """Where the traffic of an edge joins the main road; the edge may be any of the on-ramp.

    Raises:
        UserError: The net has no such edge, or following it leads to no joint.
    """
    if not net.hasEdge(link):
        raise UserError(f"the net has no edge '{link}'")
    known = {joint.link.getID(): joint for joint in joints(net)}
    edge, passed = net.getEdge(link), {link}
    while edge.getID() not in known:
        onward = [each for each in edge.getOutgoing() if each.getID() not in passed]
        if len(onward) == 1 and (others := [each for each in onward[0].getIncoming() if each is not edge]):
            through = max(others, key=lambda each: _rank(each, onward[0]))
            if not is_link(onward[0]) and _rank(through, onward[0]) >= _rank(edge, onward[0]):
                return Joint(edge, through, onward[0])
        if len(onward) != 1:
            raise UserError(f"edge '{link}' joins no road: it leads to {len(onward)} edges after '{edge.getID()}'")
        edge = onward[0]
        passed.add(edge.getID())
    return known[edge.getID()]


def course(joint: Joint, upstream: float, downstream: float) -> Course:
    """Follow both paths up to the given distances [m] from the gore, or to where the net ends.

    Raises:
        UserError: The lanes at the gore or the acceleration lane make no merge.
    """
    ramp_lane, gore_lane, host = _lanes_at_gore(joint)
    main = _follow(host, downstream, _onward(avoid=gore_lane))
    entry = min(_into(host, joint.through), key=lambda lane: int(lane.getIndex()))
    before = _follow(entry, upstream, _back)[::-1]
    ramp = _follow(ramp_lane, upstream, _back_along_ramp(joint, (*before, *main)))[::-1]
    if gore_lane is host:
        return Course((*before, *main), len(before), tuple(ramp), (), None, "")
    beside, exit_lane, ending = _beside(gore_lane, main)
    return Course((*before, *main), len(before), tuple(ramp), tuple(beside), exit_lane, ending)


def is_link(edge: Edge) -> bool:
    """Whether an edge's type, or its name where it has no type, says that it is a link."""
    return str(edge.getType() or edge.getName() or "").endswith(LINK)


def turn(edge: Edge, onward: Edge) -> float:
    """Change of direction from one edge's end to another's start [degrees], left positive."""
    difference = _heading(onward.getShape()[:2]) - _heading(edge.getShape()[-2:])
    return math.degrees((difference + math.pi) % (2.0 * math.pi) - math.pi)


def _heading(segment: list[tuple[float, float]]) -> float:
    (x, y), (further_x, further_y) = segment
    return math.atan2(further_y - y, further_x - x)


def _rank(edge: Edge, onward: Edge) -> tuple[bool, int, float, float]:
    """How much an edge looks like the main road into (or out of) another: the greater the more."""
    return not is_link(edge), edge.getLaneNumber(), edge.getSpeed(), -round(abs(turn(edge, onward)), 3)


def _lesser_than(through: Edge) -> Callable[[Edge], bool]:
    def joins(edge: Edge) -> bool:
        own, other = (edge.getLaneNumber(), edge.getSpeed()), (through.getLaneNumber(), through.getSpeed())
        return own != other and own[0] <= other[0] and own[1] <= other[1]

    return joins


def _targets(edge: Edge, onward: Edge) -> dict[int, Lane]:
    """Lanes of `onward` that an edge leads to, by index, each with the lane that leads there."""
    pairs = ((link.getToLane().getIndex(), link.getFromLane()) for link in edge.getOutgoing().get(onward, ()))
    return dict(sorted(pairs))


def _lanes_at_gore(joint: Joint) -> tuple[Lane, Lane, Lane]:
    """The on-ramp's lane that merges, the lane it leads to after the gore, and the host's lane there."""
    own, through = _targets(joint.link, joint.gore), _targets(joint.through, joint.gore)
    gore, main = joint.gore, f"'{joint.through.getID()}'"
    where = f"edge '{joint.link.getID()}'"
    shared = sorted(set(own) & set(through))
    if shared:
        # Of several shared lanes the one furthest into the road; of two on-ramp lanes the one that merges.
        lane = shared[-1] if min(own) <= min(through) else shared[0]
        return own[lane], gore.getLane(lane), gore.getLane(lane)
    from_right = max(own) < min(through)
    if not from_right and min(own) < max(through):
        raise UserError(f"{where} comes in between the lanes of {main}, neither right nor left of them")
    lane = max(own) if from_right else min(own)
    host = lane + 1 if from_right else lane - 1
    if host not in through:
        raise UserError(f"{where}: no lane of {main} leads to the lane beside it, {gore.getID()}_{host}")
    return own[lane], gore.getLane(lane), gore.getLane(host)


def _beside(lane: Lane, main: list[Lane]) -> tuple[list[Lane], Lane | None, str]:
    """Follow the on-ramp's lane beside the host's until it ends; also the exit lane it leads to, and how it ends."""
    beside = [lane]
    for onward in main[1:]:
        targets = [link.getToLane() for link in beside[-1].getOutgoing()]
        further = [each for each in targets if each.getEdge() is onward.getEdge() and each is not onward]
        if not further:
            out = next((each for each in targets if each.getEdge() is not onward.getEdge()), None)
            if out is not None:
                return beside, out, f"leads to the exit {out.getID()}"
            return beside, None, "joins the host's lane" if targets else "ends"
        if abs(further[0].getIndex() - onward.getIndex()) != 1:
            return beside, None, "is no longer beside the host's"
        beside.append(further[0])
    length = sum(each.getLength() for each in beside)
    keeps_left = "; left-hand traffic cannot be read" if lane.getIndex() > main[0].getIndex() else ""
    raise UserError(
        f"the on-ramp's lane {lane.getID()} goes on beside the road for {length:.0f} m, as far as was looked or the "
        f"net reaches: no car has to merge; take a larger extract if it ends further on{keeps_left}"
    )


def _follow(lane: Lane, reach: float, step: Callable[[Lane], Lane | None]) -> list[Lane]:
    """Lanes from `lane` on, step by step, until they are `reach` metres long together."""
    lanes, edges = [lane], {lane.getEdge().getID()}
    while sum(each.getLength() for each in lanes) < reach:
        onward = step(lanes[-1])
        if onward is None or onward.getEdge().getID() in edges:
            break
        lanes.append(onward)
        edges.add(onward.getEdge().getID())
    return lanes


def _onward(avoid: Lane) -> Callable[[Lane], Lane | None]:
    """Step to the next lane of the main road; a lane that the on-ramp's lane leads to is taken last."""

    def step(lane: Lane) -> Lane | None:
        side = lane.getEdge().getLanes()
        right = avoid.getIndex() < lane.getIndex()
        beside = lane.getIndex() - 1 if right else lane.getIndex() + 1
        taken = {link.getToLane() for link in side[beside].getOutgoing()} if 0 <= beside < len(side) else set()
        targets = [link.getToLane() for link in lane.getOutgoing()]
        return _best([each for each in targets if each not in taken] or targets, lane, "after")

    return step


def _back(lane: Lane) -> Lane | None:
    return _best(_into(lane, *lane.getEdge().getIncoming()), lane, "before")


def _back_along_ramp(joint: Joint, path: Iterable[Lane]) -> Callable[[Lane], Lane | None]:
    """Step back on the on-ramp, up to a crossing, the main road, or the end of the links."""
    main = {lane.getEdge().getID() for lane in path}

    def step(lane: Lane) -> Lane | None:
        node = lane.getEdge().getFromNode()
        if len(node.getIncoming()) > 1 and len(node.getOutgoing()) > 1:
            return None
        before = _back(lane)
        if before is None or before.getEdge().getID() in main:
            return None
        return before if is_link(before.getEdge()) or not is_link(joint.link) else None

    return step


def _into(lane: Lane, *edges: Edge) -> list[Lane]:
    """Lanes of the given edges that lead to a lane."""
    target = lane.getEdge()
    return [
        link.getFromLane() for edge in edges for link in edge.getOutgoing().get(target, ()) if link.getToLane() is lane
    ]


def _best(lanes: Iterable[Lane], lane: Lane, where: str) -> Lane | None:
    """The lane whose edge looks most like the same road; of several on one edge the right-most."""

    def angle(other: Lane) -> float:
        pair = (other.getEdge(), lane.getEdge())
        return abs(turn(*pair) if where == "before" else turn(*reversed(pair)))

    def rank(other: Lane) -> tuple[bool, int, int, int]:
        edge = other.getEdge()
        return not is_link(edge), -round(angle(other)), edge.getLaneNumber(), -other.getIndex()

    return max((other for other in lanes if angle(other) < MAX_TURN), key=rank, default=None)

"""Follow one road through a SUMO net: which edge it goes on as, and which lanes lead along it.

The edges come first, then the lanes: of all lanes that can be reached, those that lead only to an exit drop out where
the road passes it, and a path is traced back from the lanes that are left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

Edge = Any
Lane = Any
"""sumolib's classes, which carry no types."""
Costs = dict[Lane, tuple[tuple[int, float, int], Lane | None]]
"""Least cost of each lane (lanes avoided, metres aside, indices), and the lane before it."""

OSM = "highway."
"""How types of OpenStreetMap begin."""
LINK = "_link"
"""End of a link's type."""
CLASSES = ("tertiary", "secondary", "primary", "trunk", "motorway")
"""Classes of roads, from the least to the greatest."""
CAR = "passenger"
"""The vehicle class that must be allowed."""
MAX_TURN = 90.0
"""A road goes on at less than this angle [degrees]; anything else is another road, or the way back."""
BEYOND = 2000.0
"""Road looked at beyond the end of a path [m], so that the path does not end on a lane of the next exit."""


@dataclass(frozen=True)
class Trace:
    """Lanes of one road in the order in which they were found.

    Attributes:
        lanes: The lanes; the first is where the trace began.
        passed: Edges that the road does not go on as, each beside the edge that it leaves or joins.
        stop: Why it goes no further, in words; empty if it is as long as was asked for.
    """

    lanes: tuple[Lane, ...]
    passed: tuple[Edge, ...]
    stop: str


def is_link(edge: Edge) -> bool:
    """Whether an edge is a link by its type, or by its name where it has no type."""
    return str(edge.getType() or edge.getName() or "").endswith(LINK)


def has_cars(edge: Edge) -> bool:
    """Whether passenger cars may use an edge."""
    return bool(edge.allows(CAR))


def road_class(edge: Edge) -> int:
    """Road class of an edge, higher for more important roads; 0 for any other kind, -1 without a known type."""
    kind = str(edge.getType() or "")
    if not kind.startswith(OSM):
        return -1
    name = kind.removeprefix(OSM).removesuffix(LINK)
    return CLASSES.index(name) + 1 if name in CLASSES else 0


def keeps_left(edge: Edge) -> bool:
    """Whether traffic keeps left: an edge's lane 0 lies left of the others; of a single lane it is not known."""
    lanes = edge.getLanes()
    if len(lanes) < 2:
        return False
    (x, y), (next_x, next_y) = lanes[0].getShape()[:2]
    other = lanes[-1].getShape()[0]
    return bool((next_x - x) * (other[1] - y) - (next_y - y) * (other[0] - x) < 0.0)


def turn(edge: Edge, onward: Edge) -> float:
    """Change of direction from one edge's end to another's start [degrees], left positive."""
    difference = _heading(onward.getShape()[:2]) - _heading(edge.getShape()[-2:])
    return math.degrees((difference + math.pi) % (2.0 * math.pi) - math.pi)


def targets(lane: Lane) -> list[Lane]:
    """Lanes that a lane leads to and that are open to cars."""
    return [link.getToLane() for link in lane.getOutgoing() if link.getToLane().allows(CAR)]


def lanes_into(lane: Lane) -> list[Lane]:
    """Lanes that lead to a lane and are open to cars."""
    edge = lane.getEdge()
    return [
        link.getFromLane()
        for links in edge.getIncoming().values()
        for link in links
        if link.getToLane() is lane and link.getFromLane().allows(CAR)
    ]


def rank(edge: Edge, onward: Edge, like: Edge) -> tuple[bool, int, bool, int, int, float, float]:
    """How likely an edge is the main road into (or out of) another; higher is more likely.

    Args:
        edge: The edge before.
        onward: The edge after.
        like: The one of the two that is compared with other edges.
    """
    other = onward if like is edge else edge
    lanes = {link.getFromLane().getIndex() for link in edge.getOutgoing().get(onward, ())}
    return (
        not is_link(like),
        road_class(like),
        like.getName() == other.getName(),
        len(lanes),
        like.getLaneNumber(),
        like.getSpeed(),
        -round(abs(turn(edge, onward)), 3),
    )


def follow(
    lane: Lane,
    reach: float,
    back: bool = False,
    avoid: Callable[[Lane], bool] = lambda lane: False,
    allowed: Callable[[Edge, Edge], bool] = lambda edge, onward: True,
) -> Trace:
    """The main road from a lane on, for at least `reach` metres where it goes so far.

    Args:
        lane: Where to begin.
        reach: Length of the lanes together, the first included [m].
        back: Upstream instead of downstream.
        avoid: Lanes that are taken only where no other leads on.
        allowed: Whether the road may go from one edge to another, in driving order.
    """
    steps: list[Costs] = [{lane: ((0, 0.0, 0), None)}]
    edges, passed, stop = [lane.getEdge()], list[list[Edge]](), ""
    while sum(edge.getLength() for edge in edges) < reach + BEYOND:
        around = _around(edges[-1], back, allowed)
        fit = (edge for edge in around if edge not in edges and _goes_on(edges[-1], edge, around[0]))
        best, costs = next(
            ((edge, costs) for edge in fit if (costs := _step(steps[-1], edge, back, avoid))), (None, {})
        )
        if best is None:
            stop = _why_last(edges[-1], list(steps[-1]), bool(around), back)
            break
        steps.append(costs)
        passed.append([edge for edge in around if edge is not best])
        edges.append(best)
    kept = 1
    while kept < len(edges) and sum(edge.getLength() for edge in edges[:kept]) < reach:
        kept += 1
    whole = sum(edge.getLength() for edge in edges[:kept]) >= reach
    beside = tuple(edge for found in passed[: kept - 1] for edge in found)
    return Trace(tuple(_traced(steps)[:kept]), beside, "" if whole else stop)


def _why_last(edge: Edge, lanes: list[Lane], goes_on: bool, back: bool) -> str:
    """Why an edge is the last of a path, in words."""
    if not goes_on:
        return f"the road {'begins' if back else 'ends'} with '{edge.getID()}'"
    reached = {each.getEdge().getID() for lane in lanes for each in (lanes_into(lane) if back else targets(lane))}
    if not reached:
        return f"the lane {'begins' if back else 'ends'} with '{edge.getID()}'"
    return f"the lane {'comes' if back else 'leads'} only {'from' if back else 'to'} {', '.join(sorted(reached))}"


def _around(edge: Edge, back: bool, allowed: Callable[[Edge, Edge], bool]) -> list[Edge]:
    """Edges that lead to an edge or that it leads to, those most like the main road first."""
    pairs = [(each, edge) if back else (edge, each) for each in (edge.getIncoming() if back else edge.getOutgoing())]
    near = [pair for pair in pairs if all(map(has_cars, pair)) and abs(turn(*pair)) < MAX_TURN and allowed(*pair)]
    which = 0 if back else 1
    near.sort(key=lambda pair: rank(pair[0], pair[1], pair[which]), reverse=True)
    return [pair[which] for pair in near]


def _goes_on(edge: Edge, onward: Edge, best: Edge) -> bool:
    """Whether an edge is the same road as the one before: the best there is, or another of its class."""
    if is_link(onward) > is_link(edge) or (not is_link(onward) and road_class(onward) < road_class(edge) - 1):
        return False
    alike = (road_class(onward), is_link(onward)) == (road_class(best), is_link(best))
    lanes = min(best.getLaneNumber(), 2) if road_class(best) > 0 else best.getLaneNumber()
    return onward is best or (alike and onward.getLaneNumber() >= lanes and onward.getSpeed() >= best.getSpeed())


def _step(lanes: Costs, edge: Edge, back: bool, avoid: Callable[[Lane], bool]) -> Costs:
    """Lanes of an edge that can be reached from others, each with its least cost and the lane before."""
    found: Costs = {}
    for lane, ((avoided, aside, index), _) in lanes.items():
        for each in lanes_into(lane) if back else targets(lane):
            if each.getEdge() is edge:
                shift = _shift(each, lane) if back else _shift(lane, each)
                cost = (avoided + avoid(each), aside + shift, index + each.getIndex())
                if each not in found or cost < found[each][0]:
                    found[each] = cost, lane
    return found


def _shift(lane: Lane, onward: Lane) -> float:
    """How far to the side of a lane's end the next one begins [m], to the metre."""
    (x, y), (end_x, end_y) = lane.getShape()[-2:]
    next_x, next_y = onward.getShape()[0]
    along = math.hypot(end_x - x, end_y - y) or 1.0
    return float(round(abs((end_x - x) * (next_y - end_y) - (end_y - y) * (next_x - end_x)) / along))


def _traced(steps: list[Costs]) -> list[Lane]:
    """The lanes of least cost, one for each step."""
    lane = min(steps[-1], key=lambda each: steps[-1][each][0])
    lanes = []
    for step in reversed(steps):
        lanes.append(lane)
        lane = step[lane][1]
    return lanes[::-1]


def _heading(segment: Sequence[tuple[float, float]]) -> float:
    (x, y), (further_x, further_y) = segment
    return math.atan2(further_y - y, further_x - x)

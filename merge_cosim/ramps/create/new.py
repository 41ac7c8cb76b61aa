"""Start a new ramp from a few numbers: straight roads, built at once, to be edited further."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.check import HARD_BRAKING
from merge_cosim.ramps.create.folder import document, require_new, write_ramp
from merge_cosim.ramps.definition import RampFile
from merge_cosim.ramps.view import ROLES

ANGLE = math.radians(5.0)
"""Between on-ramp and main road."""


@dataclass(frozen=True)
class RampNumbers:
    """What a straight ramp is made of.

    Attributes:
        lanes: Main lanes; the host drives in the right-most.
        ramp_lanes: Lanes of the on-ramp; more than one needs an acceleration lane.
        acceleration_lane: How far the on-ramp's lanes go on beside the main road after the gore [m]; 0: none, the
            on-ramp and the host's lane go on as one lane.
        upstream: Length of the main road and of the on-ramp before the gore [m].
        downstream: Length of the road after the gore [m].
        speed_limit: Speed limit [m/s].
        lane_width: Width of every lane [m].
    """

    lanes: int = 1
    ramp_lanes: int = 1
    acceleration_lane: float = 0.0
    upstream: float = 500.0
    downstream: float = 1500.0
    speed_limit: float = 29.0
    lane_width: float = 3.6

    @property
    def merging_point(self) -> float:
        """Default merging point [m past the gore]."""
        return default_merging_point(self.acceleration_lane, self.speed_limit)


def default_merging_point(acceleration_lane: float, speed_limit: float) -> float:
    """A fifth of the acceleration lane [m past the gore], about as on US-101; nearer where it takes more to brake."""
    latest = math.floor(acceleration_lane - speed_limit**2 / (2.0 * HARD_BRAKING))
    return float(max(min(round(acceleration_lane / 5), latest), 0))


def merging_point_source(acceleration_lane: float, speed_limit: float) -> str:
    """Where the default merging point comes from, in words."""
    if not acceleration_lane:
        return "The gore."
    if default_merging_point(acceleration_lane, speed_limit) == round(acceleration_lane / 5):
        return "Default: a fifth of the acceleration lane."
    return f"Default: as much of the acceleration lane is left as braking at {HARD_BRAKING:g} m/s^2 takes."


def new_ramp(folder: Path, numbers: RampNumbers) -> Path:
    """Write the plain XML and the definition of a ramp into a new folder, and build it.

    Raises:
        UserError: The folder exists and is not empty, its name is no plain word, or the numbers make no ramp.
    """
    require_new(folder)
    if numbers.ramp_lanes > 1 and not numbers.acceleration_lane:
        raise UserError(f"{folder}: {numbers.ramp_lanes} ramp lanes cannot end in one lane; give --acceleration-lane")
    if numbers.acceleration_lane >= numbers.downstream:
        raise UserError(f"{folder}: the acceleration lane is as long as the road; make --downstream longer")
    return write_ramp(
        folder, _nodes(numbers), _edges(numbers), _connections(numbers), _definition(folder.name, numbers)
    )


def _nodes(n: RampNumbers) -> str:
    left, right = (n.lanes - 0.5) * n.lane_width, -0.5 * n.lane_width
    beside = right - n.ramp_lanes * n.lane_width if n.acceleration_lane else right
    axis = (n.lanes - 1) / 2 * n.lane_width
    x, y = _ramp_start(n)
    # An acceleration lane's end and a lane that goes on as one: SUMO's own drivers let each other in by turns.
    kind = "unregulated" if n.acceleration_lane else "zipper"
    joints = [("gore", 0.0, kind)] + ([("lane_end", n.acceleration_lane, "unregulated")] if n.acceleration_lane else [])
    rows = [f'<node id="main_start" x="{-n.upstream:.2f}" y="{axis:.2f}" type="dead_end"/>']
    rows.append(f'<node id="ramp_start" x="{x:.2f}" y="{y:.2f}" type="dead_end"/>')
    for name, at, type_ in joints:
        corners = ((at - 1, beside), (at - 1, left), (at + 1, left), (at + 1, beside))
        shape = " ".join(f"{a:.2f},{b:.2f}" for a, b in corners)
        rows.append(f'<node id="{name}" x="{at:.2f}" y="0.00" type="{type_}" radius="1" shape="{shape}"/>')
    rows.append(f'<node id="main_end" x="{n.downstream:.2f}" y="{axis:.2f}" type="dead_end"/>')
    return document(
        "nodes",
        "Metres; x runs along the road and is 0 at the gore, y is 0 on the axis of the host lane. Joining nodes carry "
        "a shape 2 m long, because netconvert stretches its own at shallow angles.",
        rows,
    )


def _edges(n: RampNumbers) -> str:
    axis = (n.lanes - 1) / 2 * n.lane_width
    main = ["host", *["main"] * (n.lanes - 1)]
    end = n.acceleration_lane
    onward = "lane_end" if end else "gore"
    rows = _edge(n, "main_in", "main_start", "gore", [(-n.upstream, axis), (0.0, axis)], main)
    rows += _edge(n, "ramp", "ramp_start", "gore", [_ramp_start(n), (0.0, _ramp_end(n))], ["ramp"] * n.ramp_lanes)
    if end:
        middle = axis - n.ramp_lanes * n.lane_width / 2
        lanes = ["auxiliary"] * n.ramp_lanes + main
        rows += _edge(n, "merge", "gore", "lane_end", [(0.0, middle), (end, middle)], lanes)
    rows += _edge(n, "main_out", onward, "main_end", [(end, axis), (n.downstream, axis)], main)
    return document(
        "edges",
        "Each shape is the axis of its edge (spreadType center); length is what SUMO drives and equals the distance "
        "along the axis, node to node.",
        rows,
    )


def _edge(
    n: RampNumbers, name: str, start: str, end: str, axis: list[tuple[float, float]], roles: list[str]
) -> list[str]:
    shape = " ".join(f"{x:.2f},{y + 0.0:.2f}" for x, y in axis)
    rows = [
        f'<edge id="{name}" from="{start}" to="{end}" numLanes="{len(roles)}" speed="{n.speed_limit:.2f}" '
        f'width="{n.lane_width:.2f}" spreadType="center" length="{math.dist(*axis):.2f}" shape="{shape}">'
    ]
    for index, role in enumerate(roles):
        rows.append(f'    <lane index="{index}"><param key="role" value="{ROLES[role]}"/></lane>')
    return [*rows, "</edge>"]


def _connections(n: RampNumbers) -> str:
    links = []
    if n.acceleration_lane:
        links += [("main_in", lane, "merge", lane + n.ramp_lanes) for lane in range(n.lanes)]
        links += [("ramp", lane, "merge", lane) for lane in range(n.ramp_lanes)]
        links += [("merge", lane + n.ramp_lanes, "main_out", lane) for lane in range(n.lanes)]
    else:
        links += [("main_in", lane, "main_out", lane) for lane in range(n.lanes)] + [("ramp", 0, "main_out", 0)]
    rows = [
        f'<connection from="{start}" fromLane="{lane}" to="{end}" toLane="{onto}"/>' for start, lane, end, onto in links
    ]
    return document("connections", "Every connection there is: lane 0 is the right-most lane.", rows)


def _ramp_end(n: RampNumbers) -> float:
    """Y where the on-ramp's axis reaches the gore [m]."""
    return -(n.ramp_lanes + 1) / 2 * n.lane_width if n.acceleration_lane else 0.0


def _ramp_start(n: RampNumbers) -> tuple[float, float]:
    return -n.upstream * math.cos(ANGLE), _ramp_end(n) - n.upstream * math.sin(ANGLE)


def _definition(name: str, n: RampNumbers) -> RampFile:
    """Contents of `ramp.toml`."""
    beside = ["merge"] if n.acceleration_lane else []
    own = n.ramp_lanes - 1
    lengths = {"main_in": n.upstream, "ramp": n.upstream, "main_out": n.downstream - n.acceleration_lane}
    return RampFile(
        title=name,
        net=f"{name}.net.xml",
        main=["main_in", *beside, "main_out"],
        host_lane=[0, n.ramp_lanes, 0] if beside else [0, 0],
        ramp=["ramp", *beside],
        merging_lane=[own] * (1 + len(beside)),
        gore="merge" if beside else "main_out",
        merging_point=n.merging_point,
        speed_limit=n.speed_limit,
        lengths=lengths | dict.fromkeys(beside, n.acceleration_lane),
        sources={
            "geometry": "Designed: straight roads made by merge-cosim ramp new.",
            "merging_point": merging_point_source(n.acceleration_lane, n.speed_limit),
        },
    )

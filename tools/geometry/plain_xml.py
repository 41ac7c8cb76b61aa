"""Write a ramp's plain XML, which netconvert builds and netedit opens."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geometry.plan import Edge, Plan
from merge_cosim.core.units import FloatArray
from merge_cosim.ramps.create.folder import opening
from merge_cosim.ramps.view import ROLES

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
MADE = "    <!-- Written by tools/ramp_geometry.py from the survey in docs/geometry.md. "
JOINT = 1.0
"""Half the length of a node's shape along the road [m]."""


def write_sources(plan: Plan, folder: Path, speed_limit: float) -> None:
    """Write nodes, edges and connections of a ramp, the same bytes for the same plan; the limit in m/s."""
    for kind, text in (("nod", _nodes(plan)), ("edg", _edges(plan, speed_limit)), ("con", _connections(plan))):
        (folder / f"{plan.name}.{kind}.xml").write_text(HEAD + text, encoding="utf-8")


def _nodes(plan: Plan) -> str:
    west, south = plan.local(np.vstack([edge.shape.points for edge in plan.edges])).min(axis=0)
    east, north = plan.local(np.vstack([edge.shape.points for edge in plan.edges])).max(axis=0)
    corners = np.array([[west, south], [east, north]])
    rows = [
        f"{MADE}Metres; (0, 0) is the axis of the host lane at the gore.",
        "         Joining nodes carry a shape 2 m long, because netconvert stretches its own at shallow angles. -->",
        f'    <location netOffset="{_pair(-plan.origin)}" convBoundary="{_points(corners, ",")}"',
        f'              origBoundary="{_points(corners + plan.origin, ",")}"',
        f'              projParameter="{plan.projection}"/>',
    ]
    for name, (x, left, right) in plan.joints.items():
        across = np.array([-left, right, right, -left])
        along = np.array([x - JOINT, x - JOINT, x + JOINT, x + JOINT])
        shape = _points(plan.local(plan.frame.place(along, across)))
        (place,) = plan.local(plan.frame.place(np.array([x]), right - left))
        where = f'x="{place[0]:.2f}" y="{place[1]:.2f}"'
        rows.append(f'    <node id="{name}" {where} type="unregulated" radius="1" shape="{shape}"/>')
    for edge in plan.edges:
        for name, end in ((edge.start, 0), (edge.end, -1)):
            if name not in plan.joints:
                x, y = plan.local(edge.shape.points[end])
                rows.append(f'    <node id="{name}" x="{x:.2f}" y="{y:.2f}" type="dead_end"/>')
    return _document("nodes", rows)


def _edges(plan: Plan, speed_limit: float) -> str:
    rows = [
        f"{MADE}Each shape is the middle of its edge (spreadType center);",
        "         length is what SUMO drives, node to node along the road. 'role' is for colours. -->",
    ]
    for edge in plan.edges:
        rows += _edge(plan, edge, speed_limit)
    return _document("edges", rows)


def _edge(plan: Plan, edge: Edge, speed_limit: float) -> list[str]:
    rows = [
        f'    <edge id="{edge.name}" from="{edge.start}" to="{edge.end}" numLanes="{len(edge.lanes)}" '
        # netedit's Save Plain XML forgets a width that all lanes of an edge have, unless the edge has it.
        f'speed="{speed_limit:.2f}" width="{edge.lanes[0][1]:.2f}" spreadType="center" length="{edge.length:.2f}"',
        f'          shape="{_points(plan.local(edge.shape.points))}">',
    ]
    for index, (role, width) in enumerate(edge.lanes):
        own = edge.own_shapes.get(index)
        shape = f' shape="{_points(plan.local(own.points))}"' if own else ""
        rows.append(
            f'        <lane index="{index}" width="{width:.2f}"{shape}><param key="role" value="{ROLES[role]}"/></lane>'
        )
    return [*rows, "    </edge>"]


def _connections(plan: Plan) -> str:
    rows = [f"{MADE}Every connection there is: lane 0 is the right-most lane. -->"]
    for start, start_lane, end, end_lane in plan.connections:
        rows.append(f'    <connection from="{start}" fromLane="{start_lane}" to="{end}" toLane="{end_lane}"/>')
    return _document("connections", rows)


def _document(root: str, rows: list[str]) -> str:
    return "\n".join([opening(root), *rows, f"</{root}>"]) + "\n"


def _points(points: FloatArray, between: str = " ") -> str:
    return between.join(_pair(point) for point in points)


def _pair(point: FloatArray) -> str:
    return "{:.2f},{:.2f}".format(*(np.round(point, 2) + 0.0))

"""The two NGSIM ramps: which drawn lines make which road. x is in metres past the gore, r to the right of the axis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from geometry.frame import Frame, Tie
from geometry.lines import Line, read_lines
from geometry.plan import TOLERANCE, Edge, Plan, main_edges, through_connections
from geometry.ramp_lanes import fit_correction, joined, led, onward, up_to
from geometry.survey import SMOOTHING, lane_centres, middle, strip_widths
from merge_cosim.core.units import FloatArray

ZONE_5 = "+proj=lcc +lat_0=33.5 +lon_0=-118 +lat_1=35.4666666666667 +lat_2=34.0333333333333"
ZONE_3 = "+proj=lcc +lat_0=36.5 +lon_0=-120.5 +lat_1=38.4333333333333 +lat_2=37.0666666666667"
PLANE = "+x_0=2000000 +y_0=500000 +datum=NAD83 +units=m +no_defs"

TIES = {
    "us101": (
        Tie((16.467, 35.381), (6451137.641, 1873344.962)),
        Tie((16.447, 39.381), (6451140.329, 1873342.000)),
    ),
    "i80": (
        Tie((16.884, 48.213), (6042842.116, 2133117.662)),
        Tie((16.938, 49.463), (6042842.012, 2133118.909)),
    ),
}
"""The first two rows of `trajectories-0750am-0805am.txt` (car 2) and of `trajectories-0400-0415.txt` (car 1)."""

DRAWN = {
    "us101": {number: f"centerline{number}" for number in range(1, 6)} | {6: "auxilliary"},
    "i80": {number: f"centerline{number}" for number in range(1, 7)} | {7: "onramp"},
}
"""The drawn centre line of each NGSIM lane."""

UPSTREAM, DOWNSTREAM, EXIT = 500.0, 1500.0, 300.0
"""Reach of the net before and after the gore, and length of the off-ramp [m]."""
NODES = ("main_start", "gore", "lane_end", "main_end")


def us101(geometry: Path, gore_local_y: float, weave: float, cars: pd.DataFrame) -> Plan:
    """US-101: five lanes, and an auxiliary lane from the on-ramp's loop to the off-ramp.

    Args:
        geometry: Folder with the survey files.
        gore_local_y: Local_Y of the gore [m].
        weave: Length of the auxiliary lane [m].
        cars: Rows of trajectories that set the zero of Local_X and correct lanes 7 and 8.
    """
    drawn, edges = read_lines(geometry / "centerlines101.txt"), read_lines(geometry / "boundaries101.txt")
    reference = drawn["centerline3"].smooth(SMOOTHING)
    painted = {name: _along(reference, edge) for name, edge in edges.items()}
    main = np.round(strip_widths(reference, [painted[f"boundary{number}"] for number in (1, 10, 9, 8, 7, 11)]), 2)
    axis = middle(reference, [drawn[f"centerline{lane}"] for lane in range(1, 6)], main)
    frame = tied = Frame.tied(axis, TIES["us101"], gore_local_y)
    beside = np.array([frame.gore, frame.gore + weave])
    extra = float(np.round(strip_widths(axis.part(*beside), [painted["boundary11"], painted["boundary2"]])[0], 2))
    names, half = ("main_in", "weave", "main_out"), float(main.sum()) / 2
    aside = half + extra / 2
    frame = frame.centred(cars, np.append(lane_centres(main), aside))

    lane = drawn["auxilliary"]
    on = fit_correction(frame, lane, cars[cars["Lane_ID"] == 7], 0.0, -1)
    off = fit_correction(frame, lane, cars[cars["Lane_ID"] == 8], weave, 1)
    ramp = joined(up_to(painted["boundary4"].beside(extra / 2), lane.points[0]), led(frame, lane, 0.0, aside, on))
    wide = float(painted["boundary12"].locate(lane.points[-1:])[1][0])
    leave = joined(led(frame, lane, weave, aside, off), onward(painted["boundary12"].beside(wide), lane.points[-1]))
    return Plan(
        name="us101",
        frame=frame,
        tied=tied,
        projection=f"{ZONE_5} {PLANE}",
        origin=_host_axis(frame, half, main),
        joints={"gore": (0.0, half, half + extra), "lane_end": (weave, half, half + extra)},
        edges=(
            *main_edges(frame, names, NODES, main, extra, np.array([-UPSTREAM, 0.0, weave, DOWNSTREAM])),
            Edge("ramp", "ramp_start", "gore", _last(ramp), (("ramp", extra),), UPSTREAM),
            Edge("exit", "lane_end", "exit_end", leave.part(0.0, EXIT).simple(TOLERANCE), (("exit", extra),), EXIT),
        ),
        connections=(*through_connections(names, len(main)), ("ramp", 0, "weave", 0), ("weave", 0, "exit", 0)),
        surveyed=_surveyed(frame, ramp) | {"exit_after": weave + leave.length},
        corrections={7: on, 8: off},
    )


def i80(geometry: Path, gore_local_y: float, merge: float, cars: pd.DataFrame) -> Plan:
    """I-80: six lanes, and an on-ramp whose lane runs slantwise into the sixth.

    Args:
        geometry: Folder with the survey files.
        gore_local_y: Local_Y of the gore [m].
        merge: Length of the acceleration lane [m].
        cars: Rows of trajectories that set the zero of Local_X.
    """
    drawn, edges = read_lines(geometry / "centerlines80.txt"), read_lines(geometry / "boundaries80.txt")
    reference = drawn["centerline1"].smooth(SMOOTHING)
    painted = {name: _along(reference, edge) for name, edge in edges.items()}
    strips = strip_widths(reference, [painted[f"boundary{number}"] for number in (8, 4, 3, 5, 6, 7)])
    main = np.round(np.append(strips, strips[-1]), 2)
    axis = middle(reference, [drawn[f"centerline{lane}"] for lane in range(1, 5)], main[:4])
    axis = axis.beside(float(main[4:].sum()) / 2)
    tied = Frame.tied(axis, TIES["i80"], gore_local_y)
    frame = tied.centred(cars, lane_centres(main)[:5])
    names, half, extra = ("main_in", "merge", "main_out"), float(main.sum()) / 2, float(main[-1])

    lane = drawn["onramp"]
    right = painted["boundary11"]
    taper = right.beside(float(right.locate(lane.points)[1].mean()))
    slant = joined(lane, onward(taper, lane.points[-1]))
    x = frame.locate(slant.points)[0]
    gore, end = (float(np.interp(at, x, slant.stations)) for at in (0.0, merge))
    reach = frame.locate(slant.at(np.array([gore, end])))[1] + extra / 2
    before, beside, beyond = main_edges(frame, names, NODES, main, extra, np.array([-UPSTREAM, 0.0, merge, DOWNSTREAM]))
    return Plan(
        name="i80",
        frame=frame,
        tied=tied,
        projection=f"{ZONE_3} {PLANE}",
        origin=_host_axis(frame, half, main),
        joints={"gore": (0.0, half, float(reach[0])), "lane_end": (merge, half, float(reach[1]))},
        edges=(
            before,
            beside.with_own_shape(0, slant.part(gore, end).simple(TOLERANCE)),
            beyond,
            Edge("ramp", "ramp_start", "gore", _last(slant.part(0.0, gore)), (("ramp", extra),), UPSTREAM),
        ),
        connections=(*through_connections(names, len(main)), ("ramp", 0, "merge", 0)),
        surveyed=_surveyed(frame, slant.part(0.0, gore)),
        corrections={},
    )


def _along(reference: Line, line: Line) -> Line:
    """A line in driving direction."""
    first, last = reference.locate(line.points[[0, -1]])[0]
    return line if first < last else Line(line.points[::-1])


def _host_axis(frame: Frame, half: float, main: FloatArray) -> FloatArray:
    """Where the axis of the host lane passes the gore, which becomes the net's (0, 0)."""
    return np.round(frame.place(np.zeros(1), half - float(main[-1]) / 2)[0], 2)


def _last(ramp: Line) -> Line:
    """The end of an on-ramp, made long enough by a straight piece."""
    return ramp.part(ramp.length - UPSTREAM, ramp.length).simple(TOLERANCE)


def _surveyed(frame: Frame, ramp: Line) -> dict[str, float]:
    return {
        "main_before": -frame.gore,
        "main_after": frame.axis.length - frame.gore,
        "ramp_before": -ramp.length,
    }

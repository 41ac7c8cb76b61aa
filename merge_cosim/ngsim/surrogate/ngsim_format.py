"""SUMO's trajectories as NGSIM would have published them: its columns, its lane numbers, feet."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.units import DT, FOOT, AnyArray, FloatArray
from merge_cosim.ngsim.rows import FRAME_MS
from merge_cosim.ngsim.sites import Site
from merge_cosim.ngsim.surrogate.recipe import Recipe
from merge_cosim.ngsim.table import SIMULATED
from merge_cosim.ramps.ramp import Ramp, read_net
from merge_cosim.sumo.lane_map import LaneMap

DECIMALS = 3
"""NGSIM gives positions and speeds with so many decimals [ft, ft/s]."""

CLOCKS_APART_MS = 3_600_000
"""From the clock origin of one recording to that of the next [ms]: their frames do not run on."""


def ngsim_rows(trajectories: Path, recipe: Recipe, ramp: Ramp, site: Site, recording: int) -> pa.Table:
    """Turn one run of SUMO into NGSIM's columns and units.

    Only the recorded road is kept, and of it only the cars that drive in an on-ramp lane or in the host lane there.

    Args:
        trajectories: What `simulate` wrote.
        recipe: What it was simulated by.
        ramp: Where NGSIM's lanes lie in the net.
        site: Which lanes count, and how long the recorded road is.
        recording: Number of the recording, from 0.
    """
    assert ramp.ngsim is not None
    named = ["vehicle_id", "vehicle_type", "vehicle_lane"]
    run = pq.read_table(trajectories, read_dictionary=named).to_pandas()
    numbers = {lane: number for number, along in ramp.ngsim.lanes.items() for lane in along}
    lanes = LaneMap(ramp)
    lane = _each(run["vehicle_lane"], numbers.__getitem__)
    before = _each(run["vehicle_lane"], lambda name: lanes.start(name.rpartition("_")[0]))
    x = run["vehicle_pos"].to_numpy() + before
    y = x + ramp.ngsim.gore_local_y
    filmed = (y >= 0) & (y <= site.length) & ~(np.isin(lane, site.ramp_lanes) & (x < recipe.filmed_from))
    near = np.zeros(len(run["vehicle_id"].cat.categories), dtype=bool)
    near[run["vehicle_id"].cat.codes[filmed & np.isin(lane, (*site.ramp_lanes, site.host_lane))]] = True
    rows = np.flatnonzero(filmed & near[run["vehicle_id"].cat.codes])

    run, lane, y = run.iloc[rows], lane[rows], y[rows]
    centre = _each(run["vehicle_lane"], _centres(ramp).__getitem__)
    frame = np.rint((run["timestep_time"].to_numpy() - recipe.warm_up) / DT).astype(np.int64) + 1
    kind = _each(run["vehicle_type"], lambda name: recipe.drivers[int(name.rpartition("-")[2])])
    table = pd.DataFrame(
        {
            "Vehicle_ID": pd.factorize(run["vehicle_id"])[0] + 1,
            "Frame_ID": frame,
            "Global_Time": frame * FRAME_MS + recording * CLOCKS_APART_MS,
            "Local_X": _feet(centre - run["vehicle_posLat"].to_numpy()),
            "Local_Y": _feet(y),
            "v_Length": _feet(np.array([each.length for each in kind])),
            "v_Vel": _feet(run["vehicle_speed"].to_numpy()),
            "v_Acc": _feet(run["vehicle_acceleration"].to_numpy()),
            "Lane_ID": lane,
            "Location": site.recording.location,
            "segment": f"{SIMULATED}{recording + 1}",
        }
    )
    return pa.Table.from_pandas(table.sort_values(["Vehicle_ID", "Frame_ID"]), preserve_index=False)


def _each(column: pd.Series[Any], value: Callable[[str], Any]) -> AnyArray:
    """Look up a value for each row's name, once per name."""
    return np.array([value(name) for name in column.cat.categories])[column.cat.codes]


def _feet(metres: FloatArray) -> FloatArray:
    return np.round(metres / FOOT, DECIMALS)


def _centres(ramp: Ramp) -> dict[str, float]:
    """How far each lane's centre lies to the right of the main road's left edge [m]; ramps count as beside the road."""
    net = read_net(ramp.net)
    road = sum(lane.getWidth() for lane in net.getEdge(ramp.main[0].edge).getLanes())
    centres = {}
    for edge in net.getEdges():
        right = 0.0 if edge.getID() in ramp.main_route else road
        for lane in reversed(edge.getLanes()):
            centres[lane.getID()] = right + lane.getWidth() / 2
            right += lane.getWidth()
    return centres

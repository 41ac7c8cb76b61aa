"""How far logged cars drive from our lanes' centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import sumolib

from geometry.frame import Frame
from geometry.lines import Line
from merge_cosim.core.units import FloatArray
from merge_cosim.ramps.ramp import Ramp, read_net


@dataclass(frozen=True)
class Lane:
    """Where the cars of one NGSIM lane were.

    Attributes:
        number: NGSIM's lane number.
        rows, cars: Numbers of positions and of cars.
        right: Distance of each position to the right of the lane's centre [m].
    """

    number: int
    rows: int
    cars: int
    right: FloatArray

    @property
    def median(self) -> float:
        """Median distance, to either side [m]."""
        return float(np.median(np.abs(self.right)))

    @property
    def most(self) -> float:
        """Distance that 95 % of the positions keep within [m]."""
        return float(np.percentile(np.abs(self.right), 95))

    @property
    def bias(self) -> float:
        """Median distance to the right [m]."""
        return float(np.median(self.right))


def lane_centres(ramp: Ramp, origin: FloatArray) -> dict[int, Line]:
    """Centre line of each NGSIM lane as the built net has it, in the metric state plane."""
    assert ramp.ngsim is not None
    net = read_net(ramp.net)
    return {number: Line(_shape(net, along) + origin) for number, along in ramp.ngsim.lanes.items()}


def origin_of(ramp: Ramp) -> FloatArray:
    """Point of the metric state plane that is (0, 0) in the net [m]."""
    return -np.array(read_net(ramp.net).getLocationOffset())


def _shape(net: sumolib.net.Net, lanes: list[str]) -> FloatArray:
    return np.vstack([net.getLane(lane).getShape() for lane in lanes])[:, :2]


def judge(ramp: Ramp, frame: Frame, cars: pd.DataFrame) -> list[Lane]:
    """Residual of each NGSIM lane that cars were in."""
    centres = lane_centres(ramp, origin_of(ramp))
    found = []
    for number, rows in cars.groupby("Lane_ID"):
        points = frame.plane(rows["Local_X"].to_numpy(float), rows["Local_Y"].to_numpy(float))
        right = centres[int(str(number))].locate(points)[1]
        count = len(rows[["segment", "Vehicle_ID"]].drop_duplicates())
        found.append(Lane(int(str(number)), len(rows), count, right))
    return found

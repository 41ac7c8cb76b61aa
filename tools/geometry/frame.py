"""The alignment: NGSIM's Local_X and Local_Y as distance across and along the surveyed road."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from geometry.lines import SURVEY_FOOT, Line
from merge_cosim.core.units import FOOT, FloatArray


@dataclass(frozen=True)
class Tie:
    """A published row of NGSIM's own files, which gives one place in both coordinates.

    Attributes:
        local: Local_X, Local_Y [ft].
        plane: Global_X, Global_Y: California state plane, NAD83 [US survey ft].
    """

    local: tuple[float, float]
    plane: tuple[float, float]


@dataclass(frozen=True)
class Frame:
    """Road coordinates: x [m past the gore] along the axis, r [m] to the right of it.

    Attributes:
        axis: The middle of the main road, in the metric state plane.
        gore: Arc length of the gore on the axis [m].
        gore_local_y: Local_Y of the gore [m].
        zero: r of Local_X = 0 [m].
    """

    axis: Line
    gore: float
    gore_local_y: float
    zero: float

    @classmethod
    def tied(cls, axis: Line, ties: tuple[Tie, ...], gore_local_y: float) -> Frame:
        """Lay Local_X and Local_Y on an axis so that published rows come out right, in the mean over them."""
        along, across = axis.locate(np.array([tie.plane for tie in ties]) * SURVEY_FOOT)
        local = np.array([tie.local for tie in ties]) * FOOT
        start = float(np.mean(along - local[:, 1]))
        return cls(axis, start + gore_local_y, gore_local_y, float(np.mean(across - local[:, 0])))

    def centred(self, cars: pd.DataFrame, centres: FloatArray) -> Frame:
        """Move Local_X sideways so that cars drive in the middle of their lanes, in the mean over lanes 1, 2 and so on.

        Args:
            cars: Rows with Lane_ID, Local_X and Local_Y [ft].
            centres: r of each lane's centre, from lane 1 on [m].
        """
        _, right = self.road(cars["Local_X"].to_numpy(float), cars["Local_Y"].to_numpy(float))
        lane = cars["Lane_ID"].to_numpy()
        off = [np.median(right[lane == number]) - centre for number, centre in enumerate(centres, start=1)]
        return replace(self, zero=self.zero - float(np.mean(off)))

    def road(self, local_x: FloatArray, local_y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Road coordinates x, r [m] of Local_X and Local_Y [ft]."""
        return local_y * FOOT - self.gore_local_y, local_x * FOOT + self.zero

    def plane(self, local_x: FloatArray, local_y: FloatArray) -> FloatArray:
        """Metric state plane (n, 2) [m] of Local_X and Local_Y [ft]."""
        x, r = self.road(np.asarray(local_x, dtype=float), np.asarray(local_y, dtype=float))
        return self.place(x, r)

    def place(self, x: FloatArray, r: FloatArray | float) -> FloatArray:
        """Metric state plane (n, 2) [m] of road coordinates."""
        return self.axis.place(np.asarray(x, dtype=float) + self.gore, r)

    def locate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Road coordinates x, r [m] of points in the metric state plane."""
        station, right = self.axis.locate(points)
        return station - self.gore, right

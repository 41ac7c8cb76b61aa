"""A picture of the two cars, from above."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from merge_cosim.core.colors import HOST, MERGING, ROAD
from merge_cosim.core.units import DT, FloatArray
from merge_cosim.ramps.ramp import Way

FPS = round(1.0 / DT)
"""Frames per second in real time."""
SIZE, DOTS = (8.0, 2.2), 100
"""Size of a picture [in], and its dots per inch."""
BEHIND, AHEAD = 100.0, 60.0
"""What is shown behind and ahead of the host [m]."""
ANGLE = np.radians(7.0)
"""Between ramp and main road, only to be seen: what is simulated are the ways to the merging point."""
LANE, WIDTH = 3.7, 1.9
"""Width of a lane and of a car [m]."""
FAR = 2000.0
"""How far the roads are drawn [m]."""


def _along(station: float, on_ramp: bool) -> FloatArray:
    """Where a station lies in the picture, (x, y) [m]."""
    if not on_ramp or station >= 0.0:
        return np.array([station, 0.0])
    return np.array([station * np.cos(ANGLE), station * np.sin(ANGLE)])


def body(station: float, length: float, on_ramp: bool) -> FloatArray:
    """Corners of a car with its front bumper at a station, shape (4, 2) [m]."""
    front = _along(station, on_ramp)
    heading = ANGLE if on_ramp and station < 0.0 else 0.0
    back = front - length * np.array([np.cos(heading), np.sin(heading)])
    side = 0.5 * WIDTH * np.array([-np.sin(heading), np.cos(heading)])
    return np.array([front - side, front + side, back + side, back - side])


class Drawing:
    """A figure whose cars are moved from frame to frame; the window goes along with the host."""

    def __init__(self, host: Way) -> None:
        """Draw the roads; `host` is the path that the host comes by."""
        self._on_ramp = (host == "ramp", host == "main")
        figure = Figure(figsize=SIZE, dpi=DOTS)
        self._canvas = FigureCanvasAgg(figure)
        self._axes = axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), aspect="equal", xticks=[], yticks=[])
        axes.set_ylim(-0.75 * (AHEAD + BEHIND) * SIZE[1] / SIZE[0], 0.25 * (AHEAD + BEHIND) * SIZE[1] / SIZE[0])
        for start in (_along(-FAR, False), _along(-FAR, True)):
            side = 0.5 * LANE * np.array([[0.0, 1.0], [0.0, -1.0]])
            end = np.array([FAR if start[1] == 0.0 else 0.0, 0.0])
            axes.add_patch(Polygon(np.concatenate([start + side, end - side]), color=ROAD, lw=0))
        axes.axvline(0.0, color="white", lw=2.0, ls=":")
        self._cars = [Polygon(np.zeros((4, 2)), color=color) for color in (HOST, MERGING)]
        for car in self._cars:
            axes.add_patch(car)
        place: dict[str, Any] = {"transform": axes.transAxes, "family": "monospace", "fontsize": 10.0}
        self._texts = [
            axes.text(0.62, 0.30 - 0.10 * row, "", color=color, **place)
            for row, color in enumerate(("black", HOST, MERGING))
        ]

    def frame(self, state: FloatArray, time: float) -> NDArray[np.uint8]:
        """Draw a state; returns red, green and blue, shape (height, width, 3).

        Args:
            state: Stations and speeds of host and merging car, then their lengths [m, m/s, m], shape (6,).
            time: Time since the encounter began [s].
        """
        self._axes.set_xlim(state[0] - BEHIND, state[0] + AHEAD)
        self._texts[0].set_text(f"{time:4.1f} s")
        for car, name in enumerate(("host", "merging car")):
            station, speed, length = (float(value) for value in state[car::2])
            self._cars[car].set_xy(body(station, length, self._on_ramp[car]))
            self._texts[car + 1].set_text(f"{name:11s} {station:7.1f} m {speed:5.1f} m/s")
        self._canvas.draw()  # type: ignore[no-untyped-call]
        return np.array(self._canvas.buffer_rgba())[:, :, :3].copy()  # type: ignore[no-untyped-call]

"""Reading what SUMO wrote about the place of every car after every step (`--fcd-output`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from lxml import etree


def read_floating_cars(file: Path) -> pd.DataFrame:
    """Read a file of floating car data.

    Args:
        file: The file.

    Returns:
        A row per car and step: `time_s`, `car`, `type`, the front bumper's `pos_m` on its `lane`, its `x_m` and
        `y_m` in the net's coordinates, and `heading` [rad], counterclockwise from the x axis.
    """
    rows = []
    for _, step in etree.iterparse(str(file), tag="timestep"):
        time = float(step.get("time"))
        for one in step:
            rows.append((time, *(one.get(name) for name in ("id", "type", "lane", "pos", "x", "y", "angle"))))
        step.clear()
    found = pd.DataFrame(rows, columns=["time_s", "car", "type", "lane", "pos_m", "x_m", "y_m", "angle"])
    found = found.astype({"pos_m": float, "x_m": float, "y_m": float, "angle": float})
    found["heading"] = np.radians(90.0 - found.pop("angle"))  # SUMO counts clockwise from north
    return found

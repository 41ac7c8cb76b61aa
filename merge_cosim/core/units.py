"""Units and the few constants of time and tolerance that all packages share. SI everywhere inside."""

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

FOOT = 0.3048
"""Metres per foot; NGSIM's local coordinates, speeds and lengths are in feet."""

HOUR = 3600.0
"""Seconds per hour."""

DT = 0.1
"""Length of one cycle [s]: NGSIM's frame, SUMO's step and the host's update rate."""

TOLERANCE = 1e-6
"""Stations closer than this [m] are equal: `a >= b` means `a >= b - TOLERANCE`."""

MIN_SPEED = 0.5
"""Slowest speed [m/s] that a time to arrival is computed with."""

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
AnyArray = NDArray[Any]

MOST_SPEED, MOST_LENGTH = 100.0, 100.0
"""Beyond these a car's initial speed [m/s] or its length [m] is a slip."""

SpeedLimit = Annotated[float, Field(gt=0, le=100)]
"""A speed limit [m/s]; beyond 100 it is a slip."""

Share = Annotated[float, Field(ge=0, le=1)]
"""A parameter that is a share of a whole."""

Braking = Annotated[float, Field(ge=-100, le=0)]
"""A parameter that is a car's hardest braking [m/s^2], negative."""

Acceleration = Annotated[float, Field(gt=0, le=100)]
"""A parameter that is a car's hardest acceleration [m/s^2]."""

Count = Annotated[int, Field(ge=1, le=10_000)]
"""A parameter that is a number of things kept for each encounter of a batch; more would fill the memory."""


def time_to_arrival(station: FloatArray, speed: FloatArray) -> FloatArray:
    """Time [s] to reach station 0 at the present speed: `max(-s, 0) / max(v, 0.5)`."""
    return np.maximum(-station, 0.0) / np.maximum(speed, MIN_SPEED)

"""Whether the host is ahead of the merging car, and how far: the driver's side of `Observation.merging_ahead`."""

from __future__ import annotations

from typing import Literal

import numpy as np

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import TOLERANCE, BoolArray, FloatArray

Ahead = Literal["clear", "in-lane", "any"]
"""When the host counts as ahead. `clear`: its rear bumper is past the merging car's front bumper; `in-lane`: its front
is past the merging car's, both past the merging point; `any`: its front is past the merging car's."""


def host_ahead(now: Observation, ahead: Ahead) -> tuple[BoolArray, FloatArray]:
    """Whether the merging driver takes the host to be ahead, and how far it is; shape (n,) each.

    The gap [m] is from the merging car's front to the host's rear, and negative where the host is not clear.
    """
    gap = now.host_station - now.merging_station - now.host_length
    if ahead == "clear":
        return gap > TOLERANCE, gap
    is_ahead = now.host_station - now.merging_station > TOLERANCE
    if ahead == "in-lane":
        is_ahead &= np.minimum(now.merging_station, now.host_station) >= -TOLERANCE
    return is_ahead, gap

"""Whether the host is ahead of the merging car, and how far: the driver's side of `Observation.merging_ahead`."""

from __future__ import annotations

from typing import Literal

import numpy as np

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import TOLERANCE, BoolArray, FloatArray

Ahead = Literal["clear", "in-lane", "any"]
"""When the host counts as ahead. `clear`: its rear bumper is past the merging car's front bumper; `in-lane`: its front
is past the merging car's, both past the merging point; `any`: its front is past the merging car's."""


def gap_to_host(now: Observation) -> FloatArray:
    """Gap [m] from the merging car's front to the host's rear, shape (n,); negative where the host is not clear."""
    return now.host_station - now.merging_station - now.host_length


def host_is_ahead(now: Observation, ahead: Ahead) -> BoolArray:
    """Whether the merging driver takes the host to be ahead, shape (n,)."""
    if ahead == "clear":
        return gap_to_host(now) > TOLERANCE
    host_ahead = now.host_station - now.merging_station > TOLERANCE
    if ahead == "in-lane":
        host_ahead &= np.minimum(now.merging_station, now.host_station) >= -TOLERANCE
    return host_ahead

"""Random initial states, each from a stream of its own."""

from __future__ import annotations

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.random_streams import stream_keys, uniform
from merge_cosim.scenarios.sources import ByArrival

ATTEMPTS = 200
"""Merging-car states drawn for one case before the spans are found not to fit together."""


def hidden_encounters(drawn: ByArrival) -> Encounters:
    """Return the encounters that `drawn` describes.

    Raises:
        UserError: The spans leave some case without a host that matches.
    """
    n = drawn.count
    case = np.array([f"drawn-{drawn.seed}-{i:05d}" for i in range(n)])
    keys = stream_keys(np.array([f"start/{name}" for name in case]), drawn.seed)
    fixed = uniform(keys, np.zeros(n, dtype=np.int64), 2)
    lead = drawn.max_lead * (2.0 * fixed[:, 0] - 1.0)
    way, speed, low, high = (np.zeros(n) for _ in range(4))
    for attempt in range(ATTEMPTS):
        open_ = np.flatnonzero(low >= high)
        if not len(open_):
            break
        u = uniform(keys[open_], np.full(len(open_), 2 + 2 * attempt), 2)
        way[open_] = drawn.nearest + u[:, 0] * (drawn.farthest - drawn.nearest)
        speed[open_] = drawn.slowest + u[:, 1] * (drawn.fastest - drawn.slowest)
        arrival = np.maximum(way[open_] / speed[open_] - lead[open_], 1e-3)
        low[open_] = np.maximum(drawn.slowest, drawn.nearest / arrival)
        high[open_] = np.minimum(drawn.fastest, drawn.farthest / arrival)
    else:
        raise UserError("encounters: no host within these ways and speeds arrives max_lead before or after its rival")
    host_speed = low + fixed[:, 1] * (high - low)
    return Encounters.unlogged(
        case,
        "designed",
        "random",
        host_station=-host_speed * (way / speed - lead),
        host_speed=host_speed,
        host_length=drawn.length,
        merging_station=-way,
        merging_speed=speed,
        merging_length=drawn.length,
    )

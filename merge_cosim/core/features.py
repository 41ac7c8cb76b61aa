"""Features of an observation, by name, as inputs of learned policies."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import FloatArray

_OF: dict[str, tuple[Callable[[Observation], FloatArray], float]] = {
    "host_station": (lambda seen: seen.host_station, -np.inf),
    "host_speed": (lambda seen: seen.host_speed, 0.0),
    "merging_station": (lambda seen: seen.merging_station, -np.inf),
    "merging_speed": (lambda seen: seen.merging_speed, 0.0),
    "host_arrival": (lambda seen: seen.host_arrival, 0.0),
    "merging_arrival": (lambda seen: seen.merging_arrival, 0.0),
    "gap": (lambda seen: seen.gap, -np.inf),
    "lead": (lambda seen: seen.merging_station - seen.host_station, -np.inf),
}
"""What computes each, and its lower bound."""

FEATURES = tuple(_OF)
"""`host_station`, `merging_station`: front bumpers, 0 at the merging point [m]; `host_speed`, `merging_speed` [m/s];
`host_arrival`, `merging_arrival`: times to arrival at the present speeds [s]; `gap`: bumper to bumper, negative where
the bodies overlap [m]; `lead`: how far the merging car's front is ahead of the host's [m]."""


def checked(names: Sequence[str]) -> tuple[str, ...]:
    """The names of some features.

    Raises:
        UserError: There is none, or no such feature.
    """
    for name in names:
        if name not in _OF:
            raise UserError(f"observation: no feature '{name}'{did_you_mean(name, list(FEATURES))}")
    if not names:
        raise UserError(f"observation: no feature is named (choose from: {', '.join(FEATURES)})")
    return tuple(names)


def lower_bounds(names: Sequence[str]) -> FloatArray:
    """Lower bound of each feature, shape (len(names),)."""
    return np.array([_OF[name][1] for name in names])


def features(seen: Observation, names: Sequence[str]) -> FloatArray:
    """The features of n encounters, shape (len(names), n)."""
    return np.array([_OF[name][0](seen) for name in names])

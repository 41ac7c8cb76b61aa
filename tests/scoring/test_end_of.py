"""When an encounter was over whose station 0 became known later: a rule of its own, worked out by hand."""

import numpy as np
import pytest

from merge_cosim.core.observation import Observation
from merge_cosim.scoring.rules import Rules, end_of


@pytest.mark.parametrize(
    ("merging", "expected"),
    [
        (np.full(12, 0.0), 4),  # it stands at its merging point, and the host drives beside it from station 0 on
        (np.full(12, -0.1), 11),  # never past it: to the last state
        (np.linspace(20.0, 64.0, 12), 7),  # far ahead: the horizon of three cycles after both are past it
        (np.linspace(1.0, 12.0, 12), 7),  # bumper to bumper, which is no overlap
        (np.linspace(1.0, 12.0, 12) - 2e-6, 4),  # closer than that
    ],
)
def test_the_first_overlap_or_the_horizon_or_the_last_state(merging, expected):
    host, speed, length = np.linspace(-4.0, 7.0, 12), np.full(12, 10.0), np.full(12, 5.0)
    states = Observation(host, speed, merging, speed, length, length)
    assert end_of(states, Rules(horizon=0.3)) == expected

"""When an encounter was over whose station 0 became known later: a rule of its own, worked out by hand."""

import numpy as np
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation
from merge_cosim.scenarios.scenario import load_scenario
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


def test_an_overlap_ends_it_cycles_after_both_are_past_the_point():
    """Both are past it from cycle 4 on; they come closer than their lengths in cycle 9, five later."""
    host, speed, length = np.linspace(-4.0, 9.0, 14), np.full(14, 10.0), np.full(14, 5.0)
    states = Observation(host, speed, np.linspace(17.0, 4.0, 14), speed, length, length)
    assert end_of(states, Rules(horizon=0.8)) == 9
    assert end_of(states, Rules(horizon=0.4)) == 8
    assert end_of(states, Rules(horizon=0.8, time_out=0.7)) == 7


@pytest.mark.parametrize("name", ["horizon", "time_out"])
def test_times_of_scoring_are_positive_and_at_most_an_hour(name):
    assert getattr(load_scenario("designed-2", {f"test.{name}": 3600}).test, name) == 3600
    assert getattr(load_scenario("designed-2", {f"test.{name}": 0.1}).test, name) == 0.1
    for wrong in (3600.5, 0, -1):
        with pytest.raises(UserError, match=f"test.{name} = {wrong}: Input should be "):
            load_scenario("designed-2", {f"test.{name}": wrong})

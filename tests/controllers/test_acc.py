"""Distance keeping against values computed by hand."""

import numpy as np
import pytest

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.observation import Observation, Setting


def command(host, merging, target=True, **gains):
    controller = Acc(**gains)
    controller.start(1, Setting(speed_limit=29.0))
    one = np.array
    seen = Observation(one([host[0]]), one([host[1]]), one([merging[0]]), one([merging[1]]), one([9.0]), one([5.0]))
    return controller.command(seen, np.zeros(1), np.array([target]))[0]


def test_keeps_the_headway():
    # gap 17 = d0 + T v at 10 m/s: nothing to do
    assert command((-50.0, 10.0), (-28.0, 10.0)) == pytest.approx(0.0)
    # 1 m too far: k_gap; 1 m/s slower: -k_speed
    assert command((-50.0, 10.0), (-27.0, 10.0)) == pytest.approx(0.23)
    assert command((-50.0, 10.0), (-28.0, 9.0)) == pytest.approx(-0.6)


def test_free_driving_bounds_the_chase_and_rules_without_a_target():
    assert command((-50.0, 28.0), (200.0, 28.0)) == pytest.approx(0.4)
    assert command((-50.0, 10.0), (-49.0, 10.0), target=False) == pytest.approx(2.0)
    assert command((-50.0, 31.0), (-49.0, 10.0), target=False) == pytest.approx(-0.8)


def test_bounds():
    assert command((-50.0, 20.0), (-50.0, 0.0)) == pytest.approx(-4.0)
    assert command((-50.0, 20.0), (-50.0, 0.0), min_acceleration=-9.0) == pytest.approx(-9.0)

"""The compiled loops against closed forms."""

import numpy as np
import pytest

from merge_cosim.controllers.compiled.policies import HostLaw, host_acceleration, time_left
from merge_cosim.controllers.compiled.predictions import predict
from merge_cosim.controllers.compiled.rollouts import least_time
from merge_cosim.controllers.rollout import POLICIES


def test_constant_speeds_give_the_gap_of_two_straight_lines():
    """Both at 10 m/s, the host 3 m ahead of the merging car, both 5 m long and past the merging point."""
    state = tuple(np.array([value]) for value in (8.0, 10.0, 5.0, 10.0, 5.0, 5.0))
    gap, slow = predict(state, np.zeros((2, 1)), np.zeros(1), 6, 1.0, 20.0)
    assert gap.shape == (2, 1, 1)
    assert gap == pytest.approx(3.0 - 5.0)
    assert slow[0, 0] == pytest.approx(0.5)  # 10 of 20 m/s are lost


def test_no_gap_before_both_are_past_the_merging_point():
    state = tuple(np.array([value]) for value in (-500.0, 10.0, 5.0, 10.0, 5.0, 5.0))
    gap, _ = predict(state, np.zeros((2, 1)), np.zeros(1), 6, 1.0, 20.0)
    assert np.isinf(gap).all()


LAW = HostLaw(
    k_free=0.4,
    k_gap=0.23,
    k_speed=0.6,
    d0=2.0,
    headway=1.5,
    min_acceleration=-4.0,
    max_acceleration=2.0,
    behind_margin=1.2,
    change=3.0,
    steps=32,
    step=0.25,
    goal=50.0,
    scored=3.0,
    overlap=20.0,
    spread=0.5,
    spread_rate=0.5,
    progress=1.0,
    effort=0.1,
    sudden=0.1,
    courtesy=1.0,
    end_braking=3.0,
    reacts=True,
)


def test_the_time_for_the_way_that_is_left():
    """0.2 of what is missing to the limit is pulled, at most 2 and at least 0.05 m/s^2."""
    assert time_left(100.0, 10.0, 20.0, LAW) == pytest.approx((np.sqrt(100 + 2 * 2 * 100) - 10) / 2)
    assert time_left(100.0, 20.0, 20.0, LAW) == pytest.approx((np.sqrt(400 + 2 * 0.05 * 100) - 20) / 0.05)
    for speed in (0.0, 10.0, 25.0):
        assert least_time(100.0, speed, 20.0, LAW) < time_left(100.0, speed, 20.0, LAW)
    assert least_time(201.0, 10.0, 20.0, LAW) == 0.0


def test_free_driving_closes_in_on_the_limit_within_bounds():
    free = POLICIES.index("free")
    wanted = [host_acceleration(free, 0.0, -50.0, speed, -60.0, 10.0, 5.0, LAW, 20.0) for speed in (5.0, 18.0, 20.0)]
    assert wanted == pytest.approx([2.0, 0.8, 0.0])

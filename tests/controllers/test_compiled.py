"""The compiled loops against closed forms."""

import numpy as np
import pytest

from merge_cosim.controllers.compiled.predictions import predict
from merge_cosim.controllers.compiled.rollouts import HostLaw, host_acceleration
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


def test_free_driving_closes_in_on_the_limit_within_bounds():
    law = HostLaw(
        0.4, 0.23, 0.6, 2.0, 1.5, -4.0, 2.0, 1.2, 3.0, 32, 0.25, 50.0, 3.0, 20.0, 0.5, 0.5, 1.0, 0.1, 0.1, True
    )
    free = POLICIES.index("free")
    wanted = [host_acceleration(free, 0.0, -50.0, speed, -60.0, 10.0, 5.0, law, 20.0) for speed in (5.0, 18.0, 20.0)]
    assert wanted == pytest.approx([2.0, 0.8, 0.0])

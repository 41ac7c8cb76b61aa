"""The one rule by which a host follows the car ahead."""

import numpy as np
import pytest

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.brake import Brake
from merge_cosim.controllers.lqr import Lqr
from merge_cosim.core.observation import Setting
from merge_cosim.simulation.leader import LeaderRule

SPEED = np.array([20.0, 20.0, 20.0])
LEADER = np.array([[np.inf, 11.0, 100.0], [0.0, 15.0, 30.0]])


@pytest.mark.parametrize("controller", [Acc(headway=1.0), Lqr(), Brake()])
def test_the_smaller_of_the_method_and_the_leader_counts(controller):
    rule = LeaderRule(controller, Setting())
    # a gap of 11 m is far too small at 20 m/s behind a slower car; 100 m behind a faster one hinder nothing
    assert rule.cap(np.array([1.0, 1.0, 1.0]), SPEED, LEADER).tolist() == [1.0, -4.0, 1.0]
    assert rule.cap(np.array([-4.0, -4.0, -4.0]), SPEED, LEADER).tolist() == [-4.0] * 3
    assert rule.without_merging_car(SPEED, LEADER).tolist() == [2.0, -4.0, 2.0]


def test_the_law_is_that_of_the_methods_controller():
    near = np.array([[32.0], [20.0]])
    one, other = (
        LeaderRule(Acc(headway=headway), Setting()).without_merging_car(SPEED[:1], near) for headway in (1.5, 1.0)
    )
    assert one[0] == pytest.approx(0.0)
    assert other[0] == pytest.approx(2.0)  # 10 m too large a gap

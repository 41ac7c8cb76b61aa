"""LQR: the gain against the Riccati recursion, and what Algorithm 1 commands."""

import numpy as np
import pytest

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.lqr import Lqr, LqrDirect
from merge_cosim.core.observation import Observation, Setting


def ready(controller, dt=0.1):
    controller.start(1, Setting(speed_limit=29.0, dt=dt))
    return controller


def command(controller, host, merging, target=True):
    def one(value):
        return np.array([float(value)])

    now = Observation(*map(one, (*host, *merging, 5, 5)))
    return ready(controller).command(now, np.zeros(1), np.array([target]))[0]


def recursion(headway, q_gap, q_speed, r, dt):
    a, b = np.array([[1.0, dt], [0.0, 1.0]]), np.array([-(headway * dt + dt**2), -dt])
    cost = np.zeros((2, 2))
    for _ in range(5000):
        gain = b @ cost @ a / (r + b @ cost @ b)
        cost = np.diag([q_gap, q_speed]) + a.T @ cost @ a - np.outer(gain, gain) * (r + b @ cost @ b)
    return -gain


@pytest.mark.parametrize(
    ("parameters", "dt"),
    [({}, 0.1), ({"headway": 1.0}, 0.1), ({"q_gap": 0.5, "q_speed": 0.0, "r": 3.0}, 0.1), ({}, 0.5)],
)
def test_gain_is_the_limit_of_the_riccati_recursion(parameters, dt):
    lqr = ready(Lqr(**parameters), dt)
    expected = recursion(lqr.headway, lqr.q_gap, lqr.q_speed, lqr.r, dt)
    np.testing.assert_allclose([lqr.gain_gap, lqr.gain_speed], expected, rtol=1e-8)


def test_gain_of_the_defaults():
    lqr = ready(Lqr())
    assert lqr.gain_gap == pytest.approx(0.213, abs=1e-3)
    assert lqr.gain_speed == pytest.approx(0.569, abs=1e-3)


def test_the_closed_loop_closes_the_gap():
    lqr = ready(Lqr())
    gap, speed, lead = 60.0, 20.0, 12.0
    for _ in range(600):
        speed += 0.1 * float(lqr.clip(lqr.follow(np.array([gap]), np.array([speed]), np.array([lead])))[0])
        gap += 0.1 * (lead - speed)
    assert gap == pytest.approx(2.0 + 1.5 * 12.0, abs=0.01)


def test_command_free_driving_and_bounds():
    assert command(Lqr(), (-50, 10), (-28, 10)) == pytest.approx(0.0)
    assert command(Lqr(), (-50, 10), (-27, 10)) == pytest.approx(0.213, abs=1e-3)
    assert command(Lqr(), (-50, 10), (-28, 9)) == pytest.approx(-0.569, abs=1e-3)
    assert command(Lqr(), (-50, 20), (-50, 0)) == -4.0
    for host in ((-50, 28), (-50, 31), (-50, 10)):
        assert command(Lqr(), host, (-49, 10), target=False) == command(Acc(), host, (-49, 10), target=False)
    assert command(Lqr(), (-50, 28), (200, 28)) == pytest.approx(0.4)


def test_direct_decelerates_whenever_the_driver_does_not_yield():
    far, near = ((-80, 15), (-10, 15)), ((-50, 20), (-50, 5))
    assert command(Lqr(), *far) > 0
    assert command(LqrDirect(), *far) == -1.0
    assert command(LqrDirect(deceleration=2.5), *far) == -2.5
    assert command(LqrDirect(deceleration=9.0), *far) == -4.0
    assert command(LqrDirect(), *near) == command(Lqr(), *near) == -4.0
    assert command(LqrDirect(), *far, target=False) == command(Lqr(), *far, target=False) > 0


def test_direct_is_lqr_once_the_merging_car_is_in_the_lane():
    assert command(LqrDirect(), (-60, 12), (0, 15)) == command(Lqr(), (-60, 12), (0, 15)) > 0

"""The designed strategy against values computed by hand, in all three meanings of 'ahead'."""

import numpy as np
import pytest

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.merging_cars.designed import Designed


def next_speed(ahead, host, merging):
    driver = Designed(ahead=ahead)
    driver.setting = Setting(speed_limit=29.0)
    one = np.array
    now = Observation(one([host[0]]), one([host[1]]), one([merging[0]]), one([merging[1]]), one([5.0]), one([5.0]))
    return driver.next_speed(np.zeros(1, dtype=int), now)[0]


FREE = 10.0 + 0.2  # full acceleration 2 m/s^2 for one cycle


@pytest.mark.parametrize("ahead", ["clear", "in-lane", "any"])
def test_nobody_ahead_means_free_driving(ahead):
    assert next_speed(ahead, (-60.0, 10.0), (-50.0, 10.0)) == pytest.approx(FREE)


def test_clear_needs_a_whole_car_length():
    assert next_speed("clear", (-45.0, 10.0), (-50.0, 10.0)) == pytest.approx(FREE)  # bumper to bumper: a tie, not past
    assert next_speed("clear", (-45.0 + 5e-7, 10.0), (-50.0, 10.0)) == pytest.approx(FREE)  # within the tolerance
    # gap 1: 0.23 (1 - (2 + 1.0 * 10)) = -2.53
    assert next_speed("clear", (-44.0, 10.0), (-50.0, 10.0)) == pytest.approx(10.0 - 0.253)


def test_in_lane_needs_both_past_the_merging_point():
    assert next_speed("in-lane", (-44.0, 10.0), (-50.0, 10.0)) == pytest.approx(FREE)
    assert next_speed("in-lane", (6.0, 10.0), (0.0, 10.0)) == pytest.approx(10.0 - 0.253)


def test_any_goes_by_the_front():
    # 1 m ahead, gap -4: 0.23 (-4 - 12) = -3.68
    assert next_speed("any", (-49.0, 10.0), (-50.0, 10.0)) == pytest.approx(10.0 - 0.368)


def test_never_backwards():
    assert next_speed("any", (-49.0, 0.0), (-50.0, 0.1)) == 0.0

"""What controllers of following share, and full braking, by hand."""

from dataclasses import dataclass

import numpy as np
import pytest

from merge_cosim.controllers.brake import Brake
from merge_cosim.controllers.following import Following
from merge_cosim.controllers.law import DistanceKeeping
from merge_cosim.core.observation import Observation, Setting

HOST, MERGING = (-50.0, 10.0), (-20.0, 8.0)


def seen(cars: int) -> Observation:
    return Observation(*(np.full(cars, value) for value in (*HOST, *MERGING, 9.0, 5.0)))


@dataclass(kw_only=True)
class GapItself(Following):
    """Accelerates by a tenth of the gap."""

    def follow(self, gap, speed, leader_speed):
        return 0.1 * gap + leader_speed - speed


def test_the_gap_is_from_the_front_of_the_host_to_the_rear_of_the_merging_car():
    controller = GapItself()
    controller.start(2, Setting(speed_limit=14.0))
    given = controller.command(seen(2), np.zeros(2), np.array([True, False]))
    assert given == pytest.approx([0.1 * (50.0 - 20.0 - 5.0) - 2.0, 0.4 * (14.0 - 10.0)])


def test_the_law_of_distance_keeping():
    law = DistanceKeeping(k_gap=0.2, k_speed=0.5, d0=2.0, headway=1.5)
    one = np.array
    assert law.gap_error(one([20.0]), one([10.0])) == pytest.approx([3.0])
    assert law.follow(one([20.0]), one([10.0]), one([8.0])) == pytest.approx([0.2 * 3.0 - 0.5 * 2.0])
    assert law.drive(one([True]), one([99.0]), one([10.0]), one([8.0]), 11.0) == pytest.approx([0.4])
    assert law.clip(one([-9.0, 0.5, 9.0])).tolist() == [-4.0, 0.5, 2.0]


def test_brake_brakes_whatever_is_seen():
    assert Brake(min_acceleration=-6.0).command(seen(3), np.zeros(3), np.ones(3, dtype=bool)).tolist() == [-6.0] * 3

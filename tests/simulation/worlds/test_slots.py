"""Meetings in the rows of a method's batch: what a row remembers, and whom a host keeps distance to."""

from dataclasses import dataclass

import numpy as np
import pytest

from merge_cosim.controllers.base import Controller, controllers
from merge_cosim.core.observation import Setting
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.worlds.actors import Actor
from merge_cosim.simulation.worlds.meetings import Meeting
from merge_cosim.simulation.worlds.slots import ROWS, SlotBatch

POINT = 40.0
"""Where cars usually merge [m past the gore]."""


@dataclass(kw_only=True)
class Counting(Estimator):
    """Returns how many cycles a row has seen since its reset, and keeps the streams that it was given."""

    def start(self, count, setting):
        self.age, self.keys = np.zeros(count), []

    def reset(self, rows, labels, keys):
        self.age[rows] = 0
        self.keys += keys.tolist()

    def update(self, seen):
        self.age += 1
        return self.age.copy()


@dataclass(kw_only=True)
class CountingController(Controller):
    def start(self, count, setting):
        self.age = np.zeros(count)

    def reset(self, rows):
        self.age[rows] = 0

    def command(self, seen, log_odds, target):
        self.age += 1
        return self.age.copy()


def meeting(host="h", merging="m", host_x=0.0, merging_x=0.0):
    actors = (Actor(host, 5.0, 2.5, x=host_x, speed=20.0), Actor(merging, 4.0, 2.5, x=merging_x, speed=15.0))
    return Meeting(*actors, 0)


def test_a_row_forgets_the_meeting_before():
    estimator = Counting()
    slots = SlotBatch(HostDriver(estimator, CountingController()), Setting())
    meetings = [meeting(merging=f"m{number}") for number in range(ROWS)]
    for one in meetings:
        slots.begin(one, seed=0)
    assert slots.is_full
    assert len(set(estimator.keys)) == ROWS  # the same host has a stream of its own in each meeting
    for _ in range(3):
        decided = list(slots.decide(POINT))
    assert [one.meeting for one in decided] == meetings
    slots.end(meetings[5])
    late = meeting(merging="late")
    slots.begin(late, seed=0)
    found = {one.meeting: (one.log_odds, one.acceleration) for one in slots.decide(POINT)}
    assert found[late] == (1.0, 1.0)
    assert found[meetings[4]] == (4.0, 4.0)


@pytest.mark.parametrize(
    ("method", "ahead", "expected"),
    [
        ("always-yield", True, "behind"),
        ("always-yield", False, "free"),
        ("always-go", True, "behind"),
        ("always-go", False, "free"),
    ],
)
def test_a_car_that_has_merged_counts_where_it_is_whatever_is_believed(method, ahead, expected):
    law = controllers["acc"]()
    slots = SlotBatch(HostDriver(estimators[method](), law), Setting(speed_limit=29.0))
    one = meeting(host_x=60.0, merging_x=75.0 if ahead else 50.0)
    one.merged_at, one.merge_position = 0, 45.0
    slots.begin(one, seed=0)
    (decided,) = slots.decide(POINT)
    # a gap of 75 - 4 - 60 = 11 m is 21 m too small at 20 m/s, and the leader is 5 m/s slower
    assert decided.acceleration == pytest.approx({"behind": -4.0, "free": 2.0}[expected])


def test_where_a_car_will_merge_is_known_once_it_has():
    one = meeting(merging_x=30.0)
    assert one.merging_point(POINT) == POINT
    one.merging.x = 55.0
    assert one.merging_point(POINT) == pytest.approx(55.1)
    one.merged_at, one.merge_position = 3, 52.0
    assert one.merging_point(POINT) == 52.0


def test_standing_counts_before_the_lane_change():
    for merged_at, stopped in ((-1, True), (0, False)):
        one = meeting()
        one.merging.speed, one.merged_at = 0.05, merged_at
        one.record(0.0, np.inf, 0.0, np.inf, False)
        assert one.stopped is stopped

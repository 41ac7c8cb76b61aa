"""A method ready to drive: what its parts give is checked, and its batch can grow."""

from dataclasses import dataclass

import numpy as np
import pytest

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import Controller
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.base import Estimator
from merge_cosim.estimators.references import AlwaysGo
from merge_cosim.sensors.noisy import Noisy
from merge_cosim.simulation.host_driver import DriverBlocks, HostDriver

SEEN = Observation(*np.array([[-80.0, -60.0], [25.0, 24.0], [-70.0, -90.0], [20.0, 21.0], [5.0, 5.0], [4.0, 4.0]]))


@dataclass(kw_only=True)
class Belief(Estimator):
    """Believes what it was given."""

    values: np.ndarray

    def update(self, seen):
        return self.values


@dataclass(kw_only=True)
class Command(Controller):
    """Commands what it was given."""

    values: np.ndarray

    def command(self, seen, log_odds, target):
        return self.values


def decided(estimator, controller):
    driver = HostDriver(estimator, controller)
    driver.start(2, Setting())
    driver.reset(np.arange(2), np.zeros(2, dtype=int), np.zeros(2, dtype=np.uint64))
    return driver.decide(SEEN)


def test_certainty_is_a_number():
    log_odds, acceleration = decided(Belief(values=np.array([np.inf, -np.inf])), Acc())
    assert log_odds.tolist() == [np.inf, -np.inf]
    assert np.isfinite(acceleration).all()


@pytest.mark.parametrize(
    ("values", "amiss"),
    [
        (
            np.array([0.0, np.nan]),
            "gives NaN for a host at -60.00 m and 24.00 m/s, a merging car at -90.00 m",
        ),
        (np.float64(1.0), r"gives shape \(\) where shape \(2,\) is due"),
        (np.array(["a", "b"]), r"gives array\(\['a', 'b'\], dtype='<U1'\), where 2 numbers are due"),
        (np.ones((2, 2)), r"gives shape \(2, 2\) where shape \(2,\) is due"),
    ],
)
def test_what_is_no_number_for_each_is_refused(values, amiss):
    with pytest.raises(UserError, match=f"Belief: {amiss}"):
        decided(Belief(values=values), Acc())
    with pytest.raises(UserError, match=f"Command: {amiss}"):
        decided(AlwaysGo(), Command(values=values))


class Aiming(Acc):
    """Keeps who is to go first."""

    def command(self, seen, log_odds, target):
        self.target = target.tolist()
        return np.zeros(len(log_odds))


@pytest.mark.parametrize(
    ("log_odds", "station", "target"),
    [
        ((0.5, -0.5), (-70.0, -90.0), [True, False]),
        ((0.0, -1e-9), (-70.0, -90.0), [True, False]),
        ((-2.0, 2.0), (0.0, 0.0), [True, False]),  # in the lane, ahead of the host and behind it
        ((-2.0, 2.0), (-1.0, -1.0), [False, True]),
    ],
)
def test_in_the_lane_who_is_ahead_goes_first_and_before_it_who_is_believed_to(log_odds, station, target):
    seen = (np.array([-60.0, 60.0]), np.full(2, 25.0), np.array(station), np.full(2, 20.0), np.full(2, 5.0))
    driver = HostDriver(Belief(values=np.array(log_odds)), Aiming())
    driver.start(2, Setting())
    driver.decide(Observation(*seen, np.full(2, 4.0)))
    assert driver.controller.target == target


@dataclass(kw_only=True)
class Counting(Estimator):
    """Returns how many cycles a slot has seen since its reset, and keeps the streams that it was given."""

    def start(self, count, setting):
        self.age, self.keys, self.resting = np.zeros(count), [], []

    def reset(self, rows, labels, keys):
        self.age[rows] = 0
        self.keys += keys.tolist()

    def rest(self, rows):
        self.resting += rows.tolist()

    def update(self, seen):
        self.age += 1
        return self.age.copy()


def test_blocks_are_added_while_others_go_on():
    blocks = DriverBlocks(HostDriver(Counting(), Acc()), 2, Setting())
    blocks.make_room(2)
    blocks.reset(np.arange(2), np.zeros(2, dtype=int), np.array([7, 8], dtype=np.uint64))
    assert blocks.decide(SEEN, np.ones(2, dtype=bool))[0].tolist() == [1.0, 1.0]
    blocks.make_room(4)
    blocks.reset(np.array([1, 2]), np.zeros(2, dtype=int), np.array([9, 10], dtype=np.uint64))
    four = Observation(*(np.tile(getattr(SEEN, name), 2) for name in Observation.__match_args__))
    log_odds, acceleration = blocks.decide(four, np.array([True, True, True, False]))
    assert log_odds.tolist() == [2.0, 1.0, 1.0, 1.0]
    assert np.isfinite(acceleration).all()
    idle, _ = blocks.decide(four, np.array([False, False, True, False]))
    assert idle.tolist() == [0.0, 0.0, 2.0, 2.0]  # the first block was left out
    assert blocks.decide(four, np.array([True, False, False, False]))[0].tolist()[:2] == [3.0, 2.0]


def test_a_reset_leaves_other_blocks_alone():
    blocks = DriverBlocks(HostDriver(Counting(), Acc()), 2, Setting())
    blocks.make_room(6)
    six, every = (
        Observation(*(np.tile(getattr(SEEN, name), 3) for name in Observation.__match_args__)),
        np.ones(6, bool),
    )
    blocks.decide(six, every)
    for rows, ages in (([0], [1, 2, 2, 2, 2, 2]), ([3], [2, 3, 3, 1, 3, 3]), ([5, 0], [1, 4, 4, 2, 4, 1])):
        blocks.reset(np.array(rows), np.zeros(len(rows), dtype=int), np.array(rows, dtype=np.uint64))
        assert blocks.decide(six, every)[0].tolist() == ages
    assert [one.estimator.keys for one in blocks._blocks] == [[0, 0], [3], [5]]


def test_a_single_block_is_left_out_where_nobody_drives():
    blocks = DriverBlocks(HostDriver(Counting(), Acc()), 2, Setting())
    blocks.make_room(2)
    assert blocks.decide(SEEN, np.zeros(2, bool))[0].tolist() == [0.0, 0.0]
    assert blocks.decide(SEEN, np.array([False, True]))[0].tolist() == [1.0, 1.0]


def test_left_out_slots_leave_every_part():
    driver = HostDriver(AlwaysGo(), Acc())
    assert driver.can_thin
    for parts in ((Counting(), Acc()), (AlwaysGo(), Aiming()), (AlwaysGo(), Acc(), Noisy())):
        assert not HostDriver(*parts).can_thin
    blocks, gone = DriverBlocks(driver, 3, Setting()), []
    blocks.make_room(3)
    block = blocks._blocks[0]
    for part in (block.sensor, block.estimator, block.controller):
        part.thin = lambda rows, part=part: gone.append((type(part).__name__, rows.tolist()))
    blocks.thin(np.array([2]))
    assert gone == [("Perfect", [2]), ("AlwaysGo", [2]), ("Acc", [2])]
    assert blocks._size == 1


def test_rows_that_rest_are_those_of_their_block():
    driver = HostDriver(Counting(), Acc())
    blocks = DriverBlocks(driver, 3, Setting())
    blocks.make_room(7)
    blocks.rest(np.array([0, 2, 4, 6, 8]))
    assert [one.estimator.resting for one in blocks._blocks] == [[0, 2], [1], [0, 2]]


class Telltale(Acc):
    """Has one channel, the speed of the host."""

    name = "telltale"
    channels = ("speed",)

    def command(self, seen, log_odds, target):
        self.speed = seen.host_speed
        return super().command(seen, log_odds, target)

    def channel_values(self):
        return self.speed[None]


def test_a_block_that_has_not_decided_has_no_channel_values():
    blocks = DriverBlocks(HostDriver(AlwaysGo(), Telltale()), 1, Setting())
    blocks.make_room(2)
    blocks.reset(np.arange(2), np.zeros(2, dtype=int), np.zeros(2, dtype=np.uint64))
    for active in ((False, True), (True, False)):  # the first has never decided, then the second has in another cycle
        blocks.decide(SEEN, np.array(active))
        assert np.isfinite(blocks.channel_values()).tolist() == [list(active)]


def test_what_is_decided_comes_from_what_is_observed():
    """Until the sensor reports the merging car in the lane, a belief counts; each block keeps its own memory."""
    driver = HostDriver(AlwaysGo(), Acc(), Noisy(delay=0.2))
    blocks = DriverBlocks(driver, 1, Setting())
    blocks.make_room(2)
    nothing, keys = np.zeros(1, dtype=int), np.zeros(1, dtype=np.uint64)
    blocks.reset(np.array([0]), nothing, keys)
    commands = []
    for cycle in range(6):
        if cycle == 2:
            blocks.reset(np.array([1]), nothing, keys)
        station = np.array([-0.6 + cycle, -2.6 + cycle])
        state = (np.full(2, -5.0), np.full(2, 20.0), station, np.full(2, 10.0), np.full(2, 5.0), np.full(2, 4.0))
        commands.append(blocks.decide(Observation(*state), np.array([True, cycle >= 2]))[1].tolist())
    braking = (np.array(commands) < 0.0).T
    assert braking[0].tolist() == [False] * 3 + [True] * 3  # in the lane in cycle 1, seen there in cycle 3
    assert braking[1].tolist() == [False] * 5 + [True]  # in the lane in cycle 3, seen there in cycle 5

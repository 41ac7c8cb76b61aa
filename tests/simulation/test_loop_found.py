"""Encounters that a world finds while it runs: what the loop records, scores and counts of them."""

import numpy as np
import pytest
from cases import Same

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import Setting
from merge_cosim.estimators.references import AlwaysGo
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Everything, Loop
from merge_cosim.simulation.worlds.base import Begun, Ended, World


class Passing(World):
    """Finds its encounters: the k-th begins in cycle `begins[k]` and is gone after `cycles[k]`; the odd ones count.

    Cars keep their commanded speeds; stations are measured from a point 100 m too far, which is settled at the end.
    """

    kind = "closed-form"
    channels = ("host_x_m",)
    begins, cycles, point = (0, 0, 2, 3, 9), (4, 6, 5, 3, 50), 900.0

    def __init__(self):
        self.slots, self.now, self.open, self.kept, self.step_s = 1, -1, {}, [], 7.0
        self.vehicle_steps, self.seen, self.was_over = 0, [], []

    def start(self, encounters, setting, rules, leader, seed):
        """Nothing is known beforehand."""
        self.seed = seed

    @property
    def goes_on(self):
        return self.now < 12

    @property
    def encounters(self):
        kept = np.array(self.kept, dtype=int)
        return Encounters.unlogged(
            np.array([f"e{k}" for k in kept], dtype=str),
            "designed",
            "traffic",
            host_station=-20.0 - kept,
            host_speed=20.0 + kept,
            host_length=np.full(len(kept), 4.0),
            merging_station=-10.0 - kept,
            merging_speed=np.full(len(kept), 20.0),
            merging_length=np.full(len(kept), 5.0),
        )

    def begin(self):
        self.now += 1
        new = [k for k, begins in enumerate(self.begins) if begins == self.now]
        if not new:
            return None
        places = []
        for k in new:
            place = next(one for one in range(99) if one not in self.open)
            self.open[place] = k
            places.append(place)
        if len(self.open) > self.slots:
            self.state = np.pad(self.state, ((0, 0), (0, len(self.open) - self.slots))) if self.now else None
            self.slots = len(self.open)
        if not self.now:
            self.state = np.zeros((4, self.slots))
        for place, k in zip(places, new, strict=True):
            self.state[:, place] = -120.0 - k, -110.0 - k, 20.0 + k, 20.0
        slots, n = np.array(places), len(new)
        start = np.concatenate([self.state[:, slots], np.tile([[4.0], [5.0]], n)])
        none = np.full(n, -1)
        return Begun(slots, none, start, none, np.zeros(n, np.uint64), np.full(n, NEVER), self.state[:1, slots] + 1000)

    def command(self, speeds):
        self.speeds = speeds.copy()

    def step(self):
        self.step_s += 0.5
        self.vehicle_steps += 10
        self.state[2:] = self.speeds
        self.state[:2] += self.speeds * 0.1

    def observe(self, state, around):
        state[:], around[:] = self.state.round(6), self.state[:1].round(6) + 1000

    def show(self, log_odds):
        self.seen.append(log_odds.tolist())

    def _leave(self, places, back):
        if not places:
            return None
        gone = [self.open.pop(place) for place in places]
        cases = []
        for k in gone:
            cases.append(len(self.kept) if k % 2 else -1)
            self.kept += [k] * (k % 2)
        begun, n = 30.0 + 0.1 * np.array([self.begins[k] for k in gone]), len(gone)
        points = None if self.point is None else np.full(n, self.point)
        return Ended(np.array(places), np.array(cases), np.array([f"e{k}" for k in gone]), back, begun, points)

    def ended(self, over, age):
        self.was_over += [(self.now, self.open[place]) for place in over.tolist() if place in self.open]
        return self._leave([place for place, k in self.open.items() if age[place] == self.cycles[k] + 1], 1)

    def finish(self, age):
        return self._leave(list(self.open), 0)

    def settled(self, track, point):
        track = track.copy()
        track[0] = track[6] - point
        track[1] += 100.0
        return track


class Steady(Acc):
    """Keeps the host's speed."""

    name = "steady"

    def command(self, seen, log_odds, target):
        return np.zeros(len(seen.host_speed))


def passed(rules, traced):
    world = Passing()
    return Loop(world, None, HostDriver(AlwaysGo(), Steady()), Same(), rules, Setting(), traced).run()


@pytest.mark.parametrize("traced", [Everything(), {"e0", "e3", "e4"}, ()])
def test_encounters_that_the_world_finds(traced):
    found = passed(Rules(horizon=60.0, time_out=60.0), traced)
    lasted = [4, 6, 5, 3, 3]  # the last one is still open when the run ends, and its last state counts
    names = [f"e{k}" for k in range(5)]
    assert set(found.traces) == {name for name in names if name in traced}
    for name, trace in found.traces.items():
        k = int(name[1:])
        stations = -20.0 - k + 0.1 * (20.0 + k) * np.arange(lasted[k])
        np.testing.assert_allclose(trace["host_station_m"], stations, atol=1e-6)
        np.testing.assert_allclose(trace["host_x_m"], stations + 900.0, atol=1e-6)
        np.testing.assert_allclose(trace["merging_station_m"], -10.0 - k + 2.0 * np.arange(lasted[k]), atol=1e-6)
        begins = 30.0 + 0.1 * Passing.begins[k]
        np.testing.assert_allclose(trace["time_s"], begins + 0.1 * np.arange(lasted[k]), atol=1e-9)
    assert found.columns["end_cycle"].tolist() == [6, 3]
    np.testing.assert_allclose(found.columns["end_station"], [-21.0 + 12.6, -23.0 + 6.9], atol=1e-6)
    np.testing.assert_allclose(found.columns["end_merging_station"], [-11.0 + 12.0, -13.0 + 6.0], atol=1e-6)
    assert (found.effort.encounter_cycles, found.effort.vehicle_steps, found.effort.step_s) == (0, 120, 6.0)
    assert found.encounters.case.tolist() == ["e1", "e3"]


def test_one_that_does_not_count_hides_none_that_ends_with_it():
    world = Passing()
    world.begins, world.cycles = (0, 0), (4, 4)
    found = Loop(world, None, HostDriver(AlwaysGo(), Steady()), Same(), Rules(), Setting()).run()
    assert found.columns["end_cycle"].tolist() == [4]


def test_an_encounter_that_the_world_finds_is_over_by_its_settled_stations():
    """Both are past the point from cycle 10 on; the world lets them go on."""
    world = Passing()
    world.begins, world.cycles = (9, 0), (50, 50)
    found = Loop(world, None, HostDriver(AlwaysGo(), Steady()), Same(), Rules(horizon=0.1), Setting()).run()
    assert found.columns["end_cycle"].tolist() == [11]


@pytest.mark.parametrize("time_out", [0.2, 0.3, 0.5])
def test_room_is_made_for_encounters_that_outlast_the_longest(time_out):
    """The record holds as many cycles as the time out has, until one of the world's encounters goes on beyond it."""
    found = passed(Rules(horizon=60.0, time_out=time_out), Everything())
    most = round(time_out * 10)
    for name, trace in found.traces.items():
        k, stays = int(name[1:]), min(most, (4, 6, 5, 3, 3)[int(name[1:])])
        np.testing.assert_allclose(trace["host_station_m"], -20.0 - k + 0.1 * (20.0 + k) * np.arange(stays), atol=1e-6)
    assert found.columns["end_cycle"].tolist() == [min(most, 6), min(most, 3)]


def test_without_a_point_to_settle_an_encounter_is_over_when_it_was():
    """Stations are 100 m too small all the time, so that the time out alone ends one: e1 and e2 last longer."""
    world = Passing()
    world.point = None
    rules = Rules(horizon=60.0, time_out=0.4)
    found = Loop(world, None, HostDriver(AlwaysGo(), Steady()), Same(), rules, Setting(), Everything()).run()
    assert {name: len(trace) for name, trace in found.traces.items()} == {"e0": 4, "e1": 4, "e2": 4, "e3": 3, "e4": 3}
    assert found.columns["end_cycle"].tolist() == [4, 3]
    assert world.was_over == [(3, 0), (3, 1), (5, 2), (6, 3)]


def test_a_window_is_shown_what_is_believed():
    shown, hidden = Passing(), Passing()
    shown.shown = True
    for world in (shown, hidden):
        Loop(world, None, HostDriver(AlwaysGo(), Steady()), Same(), Rules(), Setting()).run()
    assert hidden.seen == []
    assert len(shown.seen) == 12
    assert shown.seen[0] == [-np.inf, -np.inf]


def test_the_seed_is_the_worlds():
    world, driver = Passing(), HostDriver(AlwaysGo(), Steady())
    Loop(world, None, driver, Same(), Rules(), Setting())
    assert world.seed == 0
    Loop(world, None, driver, Same(), Rules(), Setting(), seed=5)
    assert world.seed == 5

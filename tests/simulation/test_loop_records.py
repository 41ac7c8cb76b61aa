"""What the loop records, scores and counts, cycle by cycle, against a plain loop over one encounter at a time."""

from dataclasses import fields
from itertools import count

import numpy as np
import pytest
from cases import random_encounters

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.pgm import Pgm
from merge_cosim.estimators.references import AlwaysGo
from merge_cosim.merging_cars.designed import Designed
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation import loop
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Effort, Everything, Loop
from merge_cosim.simulation.worlds.base import Begun, Ended, World
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld

RULES = Rules(horizon=1.0, time_out=12.0)


class Told(Acc):
    """Has two channels, the host's station and the merging car's."""

    name = "told"
    channels = ("own", "other")

    def command(self, seen, log_odds, target):
        self.seen = np.array([seen.host_station, seen.merging_station])
        return super().command(seen, log_odds, target)

    def channel_values(self):
        return self.seen


def plain(encounters: Encounters, number: int, estimator, rules: Rules) -> dict[str, list[float]]:
    """One encounter by itself: its states from the first to the last, and what was believed and commanded in each."""
    one = encounters.take(np.array([number]))
    driver, car, first = HostDriver(estimator, Acc()), Designed(), np.zeros(1, dtype=int)
    driver.start(1, Setting())
    car.start(one, 1, Setting())
    driver.reset(first, one.label, stream_keys(one.case, 0))
    car.reset(first, first)
    exact, lengths, until = one.start[:4, 0].copy(), one.start[4:], NEVER
    found = {name: [] for name in ("state", "log_odds", "command")}
    cycle = 0
    while True:
        state = exact.round(6)
        now = Observation(*state[[0, 2, 1, 3], None], *lengths)
        found["state"].append(state)
        if cycle and until == NEVER and state[:2].min() >= -1e-6:
            until = cycle + rules.horizon_cycles
        overlap = until < NEVER and now.gap[0] < -1e-6
        if cycle and (overlap or cycle >= min(until, rules.time_out_cycles)):
            return found
        log_odds, acceleration = driver.decide(now)
        speed = max(state[2] + acceleration[0] * 0.1, 0.0)
        found["log_odds"].append(log_odds[0])
        found["command"].append(speed)
        exact[2:] = speed, car.next_speed(np.array([cycle]), now)[0]
        exact[:2] += exact[2:] * 0.1
        cycle += 1


def run(encounters, slots, estimator=AlwaysGo, controller=Acc, traced=(), rules=RULES):
    world = ClosedFormWorld(slots)
    return Loop(world, encounters, HostDriver(estimator(), controller()), Designed(), rules, Setting(), traced).run()


@pytest.mark.parametrize("slots", [1, 3, 12])
def test_every_cycle_is_that_of_a_plain_loop(slots):
    encounters = random_encounters(12, seed=8)
    pgm = Pgm()
    pgm.use(IntentionModel.load("us101-ngsim"))
    found = run(encounters, slots, lambda: pgm, Told, Everything())
    untraced = run(encounters, slots, lambda: pgm)
    some = run(encounters, slots, lambda: pgm, traced={"r3", "r7"})
    assert set(found.traces) == set(encounters.case)
    assert not untraced.traces
    assert set(some.traces) == {"r3", "r7"}
    assert list(some.traces["r3"]) == list(found.traces["r3"])[:-2]
    for number, name in enumerate(encounters.case):
        expected, trace = plain(encounters, number, pgm, RULES), found.traces[name]
        states = np.array(expected["state"])
        assert len(trace) == len(states) - 1
        assert trace["time_s"].tolist() == pytest.approx((np.arange(len(trace)) * 0.1).tolist())
        for column, values in (
            ("host_station_m", states[:-1, 0]),
            ("merging_station_m", states[:-1, 1]),
            ("host_speed_m_s", states[:-1, 2]),
            ("merging_speed_m_s", states[:-1, 3]),
            ("log_odds", expected["log_odds"]),
            ("own", states[:-1, 0]),
            ("other", states[:-1, 1]),
        ):
            np.testing.assert_array_equal(trace[column], values, err_msg=f"{name} {column}")
        wanted = (np.array(expected["command"]) - states[:-1, 2]) / 0.1
        np.testing.assert_allclose(trace["host_acceleration_m_s2"], wanted, atol=1e-9)
        for one in (found, untraced, some):
            assert one.columns["end_cycle"][number] == len(trace)
            ends = [one.columns[f"end_{what}"][number] for what in ("station", "merging_station", "speed")]
            assert ends == states[-1, :3].tolist()
    for one in (found, untraced, some):
        assert one.effort.encounter_cycles == sum(map(len, found.traces.values()))
        assert one.effort.vehicle_steps == 2 * one.effort.encounter_cycles
        for name, column in one.columns.items():
            np.testing.assert_array_equal(column, found.columns[name], err_msg=name)


def past_the_point(cycles, horizon=0.1) -> tuple[Encounters, Rules]:
    """Encounters that are over after so many cycles each: the merging car has reached the point, the host not yet."""
    cycles = np.asarray(cycles)
    n = len(cycles)
    encounters = Encounters.unlogged(
        np.array([f"c{number}" for number in range(n)]),
        "designed",
        "designed",
        host_station=-2.9 * (cycles - 1.5),
        host_speed=np.full(n, 29.0),
        host_length=np.full(n, 5.0),
        merging_station=np.full(n, 500.0),
        merging_speed=np.full(n, 29.0),
        merging_length=np.full(n, 5.0),
    )
    return encounters, Rules(horizon=horizon)


def test_what_is_over_is_scored_by_the_hundred(monkeypatch):
    """One after the other: 128 at once, then the rest; each with a slot of its own: 512 neighbours at once."""
    sizes, score = [], loop.score
    monkeypatch.setattr(loop, "score", lambda tracks, *more: (sizes.append(len(tracks.case)), score(tracks, *more))[1])
    encounters, rules = past_the_point([2] * 1030)
    run(encounters.take(np.arange(130)), 1, rules=rules)
    run(encounters.take(np.arange(128)), 1, rules=rules)
    run(encounters, 1030, rules=rules)
    run(encounters.take(np.arange(1024)), 1024, rules=rules)
    assert sizes == [128, 2, 128, 512, 512, 6, 512, 512]


@pytest.mark.parametrize(
    ("soon", "later", "thinned"),
    [
        (300, 212, []),  # too few slots for it to pay
        (257, 256, [(513, 256)]),
        (257, 257, [(514, 0)]),  # half of them is not below a half: not before all are over
        (258, 257, [(515, 257)]),
    ],
)
def test_slots_are_left_out_once_fewer_than_half_are_in_use(soon, later, thinned, monkeypatch):
    encounters, rules = past_the_point([3] * soon + [6] * later)
    expected = run(encounters, 100, rules=rules)
    seen, thin = [], Loop._thin

    def watched(self):
        before = len(self._age)
        thin(self)
        seen.append((before, len(self._age)))

    monkeypatch.setattr(Loop, "_thin", watched)
    found = run(encounters, len(encounters), rules=rules)
    assert seen == thinned
    assert found.columns["end_cycle"].tolist() == [3] * soon + [6] * later
    for name, column in found.columns.items():
        np.testing.assert_array_equal(column, expected.columns[name], err_msg=name)


def test_nothing_is_left_out_where_a_part_cannot_or_slots_are_taken_again(monkeypatch):
    encounters, rules = past_the_point([3] * 600 + [6] * 10)
    monkeypatch.setattr(Loop, "_thin", lambda self: pytest.fail("left out"))
    run(encounters, 609, rules=rules)
    run(encounters, 610, rules=rules, traced={"c0"})
    for part in (ClosedFormWorld, AlwaysGo, Designed):
        with monkeypatch.context() as patch:
            patch.setattr(part, "can_thin", False)
            run(encounters, 610, rules=rules)


@pytest.mark.parametrize("slots", [1, 3])
def test_what_it_costs_is_the_time_between_the_clocks(slots, monkeypatch):
    """Clocks that go on by 3 s at each look: two looks a cycle for the method, one before the run and one after it."""
    encounters, rules = past_the_point([4, 2, 3])
    for name, tick in (("perf_counter", 3.0), ("process_time", 0.25)):
        clock = count(5.0, tick)
        monkeypatch.setattr(loop, name, lambda clock=clock: next(clock))
    cycles = 9 if slots == 1 else 4
    effort = run(encounters, slots, rules=rules).effort
    assert (effort.wall_s, effort.cpu_s, effort.method_s) == (3 * (2 * cycles + 1), 0.25, 3 * cycles)
    assert (effort.encounter_cycles, effort.vehicle_steps) == (9, 18)


def test_efforts_add_up_but_for_the_worst():
    one, other = (Effort(*(scale * 2.0**power for power in range(len(fields(Effort))))) for scale in (1.0, 3.0))
    one.add(other)
    assert [getattr(one, field.name) for field in fields(Effort)] == [4, 8, 16, 32, 64, 128, 256, 3 * 128.0]
    one.add(Effort())
    assert one.worst_difference_m == 3 * 128.0
    assert Effort() == Effort(*[0] * len(fields(Effort)))


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


class Same(Designed):
    """Keeps the merging car's speed."""

    name = "same"

    def next_speed(self, age, now):
        return now.merging_speed


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


class Rash(Acc):
    """Commands more than its bounds allow."""

    name = "rash"

    def command(self, seen, log_odds, target):
        return np.full(len(seen.host_speed), 5.0)


@pytest.mark.parametrize("commanded", [True, False])
def test_a_host_that_leaves_the_bounds_of_its_method_is_noted_where_the_method_drives_it(commanded):
    encounters, rules = past_the_point([3, 4, 2])
    world = ClosedFormWorld(2)
    world.commanded = commanded
    found = Loop(world, encounters, HostDriver(AlwaysGo(), Rash()), Designed(), rules, Setting()).run()
    assert {name: where.tolist() for name, where in found.broken.items()} == (
        {"acceleration": [True] * 3} if commanded else {}
    )


def test_the_seed_is_the_worlds():
    world, driver = Passing(), HostDriver(AlwaysGo(), Steady())
    Loop(world, None, driver, Same(), Rules(), Setting())
    assert world.seed == 0
    Loop(world, None, driver, Same(), Rules(), Setting(), seed=5)
    assert world.seed == 5


class Misread(Same):
    """Is seen 1 m/s slower than it drives."""

    name = "misread"

    def observed_speed(self, age, speed):
        return speed - 1.0


class Seeing(AlwaysGo):
    """Keeps the merging cars' speeds that it sees."""

    name = "seeing"

    def update(self, seen):
        self.speeds = seen.merging_speed.tolist()
        return super().update(seen)


@pytest.mark.parametrize(("car", "seen"), [(Misread, 28.0), (Same, 29.0)])
def test_the_host_sees_the_speed_that_is_observed(car, seen):
    encounters, rules = past_the_point([2, 2])
    driver = HostDriver(Seeing(), Acc())
    running = Loop(ClosedFormWorld(2), encounters, driver, car(), rules, Setting())
    found = running.run()
    assert running._driver._blocks[0].estimator.speeds == [seen, seen]
    assert found.columns["end_merging_speed"].tolist() == [29.0, 29.0]

"""What the loop records, scores and counts, cycle by cycle, against a plain loop over one encounter at a time."""

from dataclasses import fields
from itertools import count

import numpy as np
import pytest
from cases import Same, random_encounters

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


@pytest.mark.parametrize(("slots", "recorded_first"), [(1, loop.RECORDED_FIRST), (3, 16), (12, loop.RECORDED_FIRST)])
def test_every_cycle_is_that_of_a_plain_loop(slots, recorded_first, monkeypatch):
    monkeypatch.setattr(loop, "RECORDED_FIRST", recorded_first)  # 16: the record grows while encounters run
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
    assert [getattr(one, field.name) for field in fields(Effort)] == [4, 8, 16, 32, 64, 128, 256, 512, 3 * 256.0]
    one.add(Effort())
    assert one.worst_difference_m == 3 * 256.0
    assert Effort() == Effort(*[0] * len(fields(Effort)))


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

"""The drivers of the shifted tests: accelerations by hand, seeds, and independence of the batch."""

import numpy as np
import pytest

from merge_cosim.controllers.base import controllers
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.ahead import host_ahead
from merge_cosim.merging_cars.hidden import IGNORE, Hidden
from merge_cosim.merging_cars.idm import Idm
from merge_cosim.merging_cars.late import LateAccelerating
from merge_cosim.scenarios.encounters import load_encounters
from merge_cosim.scenarios.scenario import family, load_scenario
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld

FEW = {"encounters.count": 40}
DESIGNED = load_scenario("designed-3", FEW)
MEMBERS = family("shifted")


def scene(host, merging, n=1):
    return Observation(*(np.full(n, value, dtype=float) for value in (*host, *merging, 5.0, 4.0)))


def acceleration(driver, host, merging, age=0):
    now = scene(host, merging)
    return (driver.next_speed(np.array([age]), now)[0] - merging[1]) / 0.1


def idm(**parameters):
    driver = Idm(**parameters)
    driver.setting = Setting(speed_limit=20.0)
    return driver


def test_idm_drives_freely_without_a_host_ahead():
    assert acceleration(idm(), (-80.0, 20.0), (-60.0, 10.0)) == pytest.approx(1.0 - 0.5**4)
    assert acceleration(idm(), (-55.0, 20.0), (-60.0, 10.0)) == pytest.approx(1.0 - 0.5**4)  # level, not clear
    assert acceleration(idm(), (-80.0, 20.0), (-60.0, 20.0)) == pytest.approx(0.0)
    assert acceleration(idm(acceleration=2.0, exponent=2.0), (-80.0, 20.0), (-60.0, 10.0)) == pytest.approx(1.5)


def test_idm_keeps_its_distance_to_a_host_ahead():
    # gap 25: s* = 2 + 10 + 10 (10 - 8) / (2 sqrt(1 * 2.25)) = 12 + 20/3
    star = 12.0 + 20.0 / 3.0
    driver = idm(braking=2.25)
    assert acceleration(driver, (-30.0, 8.0), (-60.0, 10.0)) == pytest.approx(1.0 - 0.5**4 - (star / 25.0) ** 2)
    # a host that leaves quickly: s* is no less than d0
    assert acceleration(driver, (-30.0, 18.0), (-60.0, 10.0)) == pytest.approx(1.0 - 0.5**4 - (2.0 / 25.0) ** 2)
    assert acceleration(driver, (-54.0, 8.0), (-60.0, 10.0)) == pytest.approx(-4.0)  # all that it brakes


def test_idm_takes_any_host_in_front_as_its_leader_if_set_so():
    assert acceleration(idm(ahead="any"), (-57.0, 10.0), (-60.0, 10.0)) == pytest.approx(-4.0)
    assert acceleration(idm(ahead="in-lane"), (-57.0, 10.0), (-60.0, 10.0)) == pytest.approx(1.0 - 0.5**4)


def late(station_of_change, speed_limit=29.0):
    driver = LateAccelerating()
    driver.setting, driver._way = Setting(speed_limit=speed_limit), np.array([-station_of_change])
    return driver


def test_late_acceleration_begins_at_its_point_and_ends_at_the_limit():
    assert acceleration(late(-30.0), (-90.0, 20.0), (-30.5, 10.0)) == 0.0
    assert acceleration(late(-30.0), (-20.0, 5.0), (-30.0, 10.0)) == pytest.approx(3.0)  # whatever the host does
    assert acceleration(late(-30.0, speed_limit=10.1), (-90.0, 20.0), (-20.0, 10.0)) == pytest.approx(1.0)


def test_late_acceleration_ends_behind_a_host_in_the_lane():
    # gap 20 - 0 - 5: 0.23 (15 - (2 + 8)) + 0.6 (12 - 10)
    assert acceleration(late(-30.0), (20.0, 12.0), (0.0, 10.0)) == pytest.approx(2.35)
    assert acceleration(late(-30.0), (-20.0, 12.0), (0.0, 10.0)) == pytest.approx(3.0)  # free


def test_late_points_are_drawn_per_case():
    encounters = load_encounters(load_scenario("shifted-late"), None, None)
    ways = LateAccelerating().ways(encounters)
    assert 20.0 <= ways.min() < 20.1
    assert 49.9 < ways.max() <= 50.0
    assert ways.mean() == pytest.approx(35.0, abs=0.4)
    assert (LateAccelerating(seed=1).ways(encounters) != ways).all()
    assert LateAccelerating(nearest=30.0, farthest=30.0).ways(encounters)[7] == 30.0
    with pytest.raises(ValueError, match="nearest is above farthest"):
        LateAccelerating(nearest=60.0)


def test_ahead_has_three_meanings():
    station = np.array([-40.0, -45.0 + 5e-7, -49.0, -50.0])
    now = Observation(station, np.full(4, 9.0), np.full(4, -50.0), np.full(4, 9.0), np.full(4, 5.0), np.full(4, 5.0))
    for rule, expected in (
        ("clear", [True, False, False, False]),
        ("any", [True, True, True, False]),
        ("in-lane", [False] * 4),
    ):
        ahead, gap = host_ahead(now, rule)
        assert ahead.tolist() == expected
        assert gap == pytest.approx([5.0, 5e-7, -4.0, -5.0])


def script(member):
    scenario = load_scenario(member)
    encounters = load_encounters(scenario, None, None)
    driver = scenario.merging_car()
    assert isinstance(driver, Hidden)
    return driver, driver.script(encounters)


def test_hidden_drivers_are_shifted_as_the_names_say():
    usual, before = script("designed-3")
    for member, low, high in (("shifted-margins-short", 0.2, 0.6), ("shifted-margins-long", 2.0, 4.0)):
        margin = script(member)[1].margin
        assert (margin.min(), margin.max()) == pytest.approx((low, high), abs=0.01)
    assert script("shifted-reaction")[1].reaction == pytest.approx(2.0 * before.reaction)
    changes = np.isfinite(script("shifted-changing")[1].changes_at)
    assert changes.mean() == pytest.approx(0.5, abs=0.02)
    assert changes[np.isfinite(before.changes_at)].all()
    blind = script("shifted-never-look")[1]
    assert (blind.first == IGNORE).all()
    assert (blind.last == IGNORE).all()
    assert script("shifted-noise")[0].sigma == pytest.approx(3.0 * usual.sigma)


def test_weak_brakes_are_the_plan_s_and_the_car_s():
    driver, _ = script("shifted-weak-brakes")
    driver.setting, driver._margin = Setting(), np.array([1.0])
    assert driver.plan(scene((-40.0, 20.0), (-20.0, 15.0)), np.array([0]))[0] == -2.0
    assert driver.clip(np.array([-3.0])).tolist() == [-2.0]


def run(member, rows, slots):
    scenario = load_scenario(member, FEW)
    encounters = load_encounters(scenario, None, None).take(rows)
    driver = HostDriver(estimators["slot-time"](), controllers["acc"]())
    return Loop(ClosedFormWorld(slots), encounters, driver, scenario.merging_car(), Rules(), Setting()).run().columns


@pytest.mark.parametrize("member", MEMBERS)
def test_members_start_as_designed_3_and_do_not_depend_on_the_batch(member):
    scenario, usual = load_scenario(member, FEW), load_encounters(DESIGNED, None, None)
    assert scenario.encounters == DESIGNED.encounters
    np.testing.assert_array_equal(load_encounters(scenario, None, None).start, usual.start)
    whole, rows = run(member, np.arange(40), 40), np.random.default_rng(1).permutation(40)[:15]
    for name, column in run(member, rows, 4).items():
        np.testing.assert_array_equal(column, whole[name][rows], err_msg=name)
    assert any((column != run("designed-3", np.arange(40), 40)[name]).any() for name, column in whole.items())

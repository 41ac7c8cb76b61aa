"""The driver with a hidden intention: arithmetic by hand, distributions, and independence of the batch."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from merge_cosim.controllers.base import controllers
from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.hidden import IGNORE, Hidden
from merge_cosim.scenarios.encounters import load_encounters
from merge_cosim.scenarios.hidden import hidden_encounters
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.scenarios.sources import ByArrival
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld

YIELD, NOT_YIELD = int(Intention.YIELD), int(Intention.NOT_YIELD)


def scene(host, merging, n=1):
    values = (*host, *merging, 5.0, 5.0)
    return Observation(*(np.full(n, value, dtype=float) for value in values))


def planned(intention, host, merging, margin=1.0):
    driver = Hidden()
    driver.setting = Setting()
    driver._margin = np.array([margin])
    return driver.plan(scene(host, merging), np.array([intention]))[0]


def test_yielding_brakes_just_enough_to_arrive_a_margin_after_the_host():
    # host there in 4 s, he should be there in 5 s: 40 = 10 * 5 + a * 25 / 2
    assert planned(YIELD, (-80.0, 20.0), (-40.0, 10.0)) == pytest.approx(-0.8)
    assert planned(YIELD, (-20.0, 20.0), (-40.0, 10.0)) == 0.0  # late enough as it is
    # to be there in 10 s he would have to stop before: he stops at the point
    assert planned(YIELD, (-90.0, 10.0), (-40.0, 10.0)) == pytest.approx(-100 / 80)


def test_not_yielding_accelerates_just_enough_to_arrive_a_margin_before():
    # host there in 5 s, he in 4 s: 50 = 10 * 4 + a * 8
    assert planned(NOT_YIELD, (-100.0, 20.0), (-50.0, 10.0)) == pytest.approx(1.25)
    assert planned(NOT_YIELD, (-200.0, 20.0), (-50.0, 10.0)) == 0.0
    assert planned(NOT_YIELD, (-10.0, 20.0), (-50.0, 10.0)) == 3.0  # too late: all that he can


@given(st.floats(1.0, 8.0), st.floats(5.0, 25.0), st.floats(0.8, 2.0))
def test_a_plan_arrives_when_it_says(host_time, speed, margin):
    way = speed * host_time  # without a plan both arrive together
    acceleration = planned(YIELD, (-20.0 * host_time, 20.0), (-way, speed), margin)
    time = host_time + margin
    if acceleration > -4.0 and speed + acceleration * time > 0:
        assert speed * time + acceleration * time**2 / 2 == pytest.approx(way)


def drive(driver, intention, host_speed=20.0, cycles=90):
    encounters = hidden_encounters(ByArrival(kind="drawn", count=1))
    start = replace(
        encounters, host_station=np.array([-100.0]), host_speed=np.array([host_speed]),
        merging_station=np.array([-100.0]), merging_speed=np.array([20.0]),
    )  # fmt: skip
    driver.start(start, 1, Setting())
    driver.reset(np.array([0]), np.array([0]))
    driver._first[:], driver._last[:], driver._changes_at[:] = intention, intention, np.inf
    station, speed, host = -100.0, 20.0, -100.0
    arrival = {}
    for k in range(cycles):
        now = scene((host, host_speed), (station, speed))
        speed = driver.next_speed(np.array([k]), now)[0]
        station, host = station + 0.1 * speed, host + 0.1 * host_speed
        for name, place in (("merging", station), ("host", host)):
            if place >= 0:
                arrival.setdefault(name, (k + 1) * 0.1)
    return arrival


@pytest.mark.parametrize("intention", [YIELD, NOT_YIELD])
def test_he_arrives_his_margin_apart_from_a_steady_host(intention):
    driver = Hidden(sigma=0.0, max_reaction=0.0, min_margin=1.2, max_margin=1.2)
    arrival = drive(driver, intention)
    apart = arrival["merging"] - arrival["host"]
    assert apart == pytest.approx(1.2 if intention == YIELD else -1.2, abs=0.15)


def test_who_ignores_the_host_holds_his_speed():
    arrival = drive(Hidden(sigma=0.0), IGNORE)
    assert arrival["merging"] == pytest.approx(5.0, abs=0.11)


ENCOUNTERS = load_encounters(load_scenario("designed-3"), None, None)


def test_starts_are_distributed_as_they_should_be():
    e = ENCOUNTERS
    assert len(e) == 5000
    lead = -e.merging_station / e.merging_speed + e.host_station / e.host_speed
    assert kstest(lead, "uniform", args=(-2.0, 4.0)).pvalue > 0.001
    for station, speed in ((e.host_station, e.host_speed), (e.merging_station, e.merging_speed)):
        assert ((station >= -150 - 1e-9) & (station <= -60 + 1e-9)).all()
        assert ((speed >= 8) & (speed <= 28)).all()


def test_scripts_are_distributed_as_they_should_be():
    script = Hidden().script(ENCOUNTERS)
    shares = [(script.first == kind).mean() for kind in (YIELD, NOT_YIELD, IGNORE)]
    assert shares == pytest.approx([0.4, 0.4, 0.2], abs=0.02)
    changes = np.isfinite(script.changes_at)
    assert changes.mean() == pytest.approx(0.2, abs=0.02)
    assert (script.first[changes] != script.last[changes]).all()
    assert (script.first[~changes] == script.last[~changes]).all()
    assert (script.changes_at[changes] <= -20).all()
    assert (script.changes_at[changes] >= ENCOUNTERS.merging_station[changes]).all()
    assert kstest(script.reaction / 2.0, "uniform").pvalue > 0.001
    assert kstest((script.margin - 0.8) / 1.2, "uniform").pvalue > 0.001
    np.testing.assert_array_equal(script.last, ENCOUNTERS.label)


def test_noise_has_its_deviation_and_time_constant():
    driver = Hidden(max_reaction=0.0)
    n = 400
    driver.start(ENCOUNTERS, n, Setting())
    driver.reset(np.arange(n), np.arange(n))
    noise = []
    for k in range(200):
        driver.next_speed(np.full(n, k), scene((-90.0, 15.0), (-90.0, 15.0), n))
        noise.append(driver._noise)
    noise = np.array(noise)
    assert noise.std() == pytest.approx(0.3, rel=0.03)
    assert np.corrcoef(noise[:-10].ravel(), noise[10:].ravel())[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


def test_cases_do_not_depend_on_their_batch():
    def run(rows, tiles):
        driver = HostDriver(estimators["slot-time"](), controllers["acc"]())
        return Loop(ClosedFormWorld(tiles), ENCOUNTERS.take(rows), driver, Hidden(), Rules(), Setting()).run().columns

    rows = np.arange(60)
    whole = run(rows, 60)
    order = np.random.default_rng(1).permutation(rows)
    for one, expected in ((run(order, 7), order), (run(rows[17:18], 1), rows[17:18])):
        for name, column in whole.items():
            np.testing.assert_array_equal(one[name], column[expected], err_msg=name)


def test_fewer_cases_are_the_first_ones_and_seeds_differ():
    few = hidden_encounters(ByArrival(kind="drawn", count=10))
    np.testing.assert_array_equal(few.merging_speed, ENCOUNTERS.merging_speed[:10])
    assert (hidden_encounters(ByArrival(kind="drawn", count=10, seed=1)).merging_speed != few.merging_speed).all()
    assert (Hidden(seed=1).script(ENCOUNTERS).reaction != Hidden().script(ENCOUNTERS).reaction).all()

"""The search of the smallest delay against drivers who react, against every plan of three holds."""

from itertools import product

import numpy as np
import pytest

from merge_cosim.core.observation import Setting
from merge_cosim.results.rows import delay, free_time
from merge_cosim.scenarios.encounters import load_encounters
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.studies.bounds import bounds
from merge_cosim.studies.clairvoyant import Plans, Search, search_plans

COARSE = Search(levels=(-4.0, 0.0, 2.0), hold=10, beam=81)
SETTING = Setting()


@pytest.fixture(scope="module")
def hidden():
    scenario = load_scenario("designed-3", {"encounters.count": 16})
    return scenario, load_encounters(scenario, None, None)


def drive(plans, scenario, encounters):
    world, driver = ClosedFormWorld(len(encounters)), plans.driver(encounters)
    return Loop(world, encounters, driver, scenario.merging_car(), scenario.test, SETTING).run().columns


def test_no_plan_of_three_holds_is_better(hidden):
    scenario, encounters = hidden
    n, rules = len(encounters), scenario.test
    best = np.full(n, np.inf)
    for levels in product(COARSE.levels, repeat=3):
        plan = np.tile((*levels, COARSE.levels[-1]), (n, 1))
        driven = drive(Plans(plan, COARSE.hold, best), scenario, encounters)
        passed = driven["kind"] == 0
        best[passed] = np.minimum(best, delay(driven, encounters, SETTING, rules.free))[passed]
    plans = search_plans(encounters, scenario.merging_car(), rules, SETTING, COARSE, np.arange(n))
    driven = drive(plans, scenario, encounters)
    assert not driven["kind"].any()
    found = delay(driven, encounters, SETTING, rules.free)
    assert plans.arrival - free_time(encounters.host_station, encounters.host_speed, SETTING, rules.free) == (
        pytest.approx(found, abs=1e-9)
    )
    assert (found <= best + 1e-9).all()
    assert (best > found.min()).any()


def test_a_bound_depends_on_its_case_alone(hidden):
    scenario, encounters = hidden
    every = bounds(scenario, encounters, COARSE)
    some = np.array([13, 7, 2])
    few = bounds(scenario, encounters.take(some), COARSE)
    assert every.iloc[some].reset_index(drop=True).equals(few)
    assert (every["found_delay_s"] >= every["min_delay_s"] - 1e-3).all()
    finer = bounds(scenario, encounters)
    assert finer["found_delay_s"].mean() <= every["found_delay_s"].mean()
    assert not finer["infeasible_in_time"].any()

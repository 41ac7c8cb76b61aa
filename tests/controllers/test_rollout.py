"""The rollout planner: costs against numpy, policies by hand, commitment, bounded jerk, and escapes that hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rollout_reference import costs

from merge_cosim.controllers.compiled.escapes import (
    FORCED,
    LEFT,
    NONE,
    UNSEEN,
    Bounds,
    escapes,
    kept,
    narrowed,
    waits_beside,
)
from merge_cosim.controllers.rollout import POLICIES, Rollout
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import TOLERANCE
from merge_cosim.estimators.acc import AccMerging
from merge_cosim.estimators.interactive import Interactive
from merge_cosim.simulation.host_driver import HostDriver

LIMIT = 29.0
BOUNDS = Bounds(-4.0, 2.0, 4.0, 3.0, -np.inf, 2.0, 3.0, 0.3, LIMIT, 0.1, 200)
FULL = -4.0, 3.0, 0.0


def states(n, seed=0):
    rng = np.random.default_rng(seed)
    station, speed = rng.uniform(-100, -1, (2, n)), rng.uniform(0, 28, (2, n))
    return Observation(station[0], speed[0], station[1], speed[1], rng.uniform(4, 8, n), rng.uniform(4, 8, n))


def one(host, host_speed, merging, merging_speed):
    return Observation(*(np.array([float(v)]) for v in (host, host_speed, merging, merging_speed, 5, 5)))


def column(*state, off=(0.0, 0.0, 0.0)):
    """The state of one encounter as the planner hands it on: a column, for which the kernels are compiled anyway."""
    return np.repeat([*state, 5.0, 5.0, *off], 2).reshape(-1, 2)[:, 0]


def planner(n=1, **values):
    made = Rollout(**values)
    made.start(n, Setting(LIMIT))
    made.reset(np.arange(n))
    return made


def test_costs_are_those_of_numpy():
    n = 300
    seen = states(n)
    made = planner(n, least_belief=0.0, escape=False)
    log_odds = np.linspace(-3, 3, n)
    traits = made._traits = np.tile([1.2, 1.2, 0.0, 0.0, 0.8, 35.0], (n, 1))
    for last in (np.full(n, np.nan), made.command(seen, log_odds, log_odds >= 0)):
        made._last = last.copy()
        made.command(seen, log_odds, log_odds >= 0)
        expected = costs(seen, traits, np.zeros(n), last, made, LIMIT)
        np.testing.assert_allclose(made.last_costs, expected, rtol=1e-9, atol=1e-9)


def test_the_cheapest_policy_is_chosen_though_others_are_not_rolled_out_to_their_end():
    n = 400
    seen, odds = states(n), np.linspace(-3, 3, n)
    made = planner(n, escape=False)
    for _ in range(3):
        before = made.last_policy.copy()
        made.command(seen, odds, odds >= 0)
        expected = (made.last_costs * made.last_belief[:, None]).sum(axis=2)
        best = expected.argmin(axis=1)
        stays = expected[np.arange(n), before] - made.commitment <= expected.min(axis=1)
        np.testing.assert_array_equal(made.last_policy, np.where((before >= 0) & stays, before, best))
        seen = Observation(seen.host_station, seen.host_speed * 0.7, *list(vars(seen).values())[2:])


def test_a_host_far_ahead_drives_freely_and_one_far_behind_too():
    assert planner().command(one(-40, 20, -120, 15), np.zeros(1), np.ones(1, bool))[0] == 2.0
    assert planner().command(one(-120, 15, -20, 20), np.zeros(1), np.ones(1, bool))[0] == 2.0


def test_progress_is_the_time_to_the_goal():
    made = planner(least_belief=0.0)
    made.command(one(-50, LIMIT, -500, 0), np.zeros(1), np.ones(1, bool))
    np.testing.assert_allclose(made.last_costs[0, POLICIES.index("coast")], 100 / LIMIT)
    braking = made.last_costs[0, POLICIES.index("brake 1"), 0]
    assert braking > 100 / LIMIT + 0.1 * 4


def test_a_host_does_not_wait_for_a_driver_that_waits_for_it():
    made = planner()
    seen = one(-20, 10, -0.1, 0.0)
    made.command(seen, np.full(1, -2.0), np.zeros(1, bool))
    assert made.last_belief[0, 3] > 0.6
    go, stay = (made.last_costs[0, POLICIES.index(name), 3] for name in ("free", "brake 4"))
    assert go < stay - 1.0
    assert POLICIES[made.last_policy[0]] in ("free", "accelerate 1", "accelerate 2")


def test_slowing_down_for_a_driver_that_yields_slows_the_driver():
    made = planner(least_belief=0.0)
    made.command(one(-60, 18, -58, 17), np.zeros(1), np.ones(1, bool))
    by_type = made.last_costs[0]
    assert by_type[POLICIES.index("brake 2"), 0] > by_type[POLICIES.index("free"), 0] + 1.0
    assert by_type[POLICIES.index("free"), 1] > by_type[POLICIES.index("follow"), 1]


def test_drivers_that_keep_their_first_plan_are_the_ablation():
    """A yielding driver that brakes for a host at constant speed is passed by a host that slows down."""
    seen = one(-60, 18, -58, 17)
    found = []
    for reacts in (True, False):
        made = planner(least_belief=0.0, reacts=reacts)
        made.command(seen, np.zeros(1), np.ones(1, bool))
        found.append(made.last_costs[0, POLICIES.index("coast"), [0, 2]])
    assert found[0][0] != found[1][0]
    assert found[0][1] == found[1][1]  # a driver that ignores the host does not react anyway


def test_commitment_keeps_the_policy_until_another_is_cheaper_by_that_much():
    seen, odds, target = one(-60, 18, -58, 17), np.zeros(1), np.ones(1, bool)
    for commitment, keeps in ((0.0, False), (1e6, True)):
        made = planner(commitment=commitment)
        made.last_policy[:] = POLICIES.index("brake 4")
        made.command(seen, odds, target)
        assert (made.last_policy[0] == POLICIES.index("brake 4")) == keeps


def test_jerk_is_bounded_but_for_the_two_hardest_policies():
    made = planner(escape=False, max_jerk=2.0, sudden=10.0)
    made._last[:] = -1.0
    assert made.command(one(-40, 10, -120, 5), np.zeros(1), np.ones(1, bool))[0] == pytest.approx(-0.8)
    made._last[:], made.last_policy[:], made.commitment = -1.0, POLICIES.index("brake 4"), 1e6
    assert made.command(one(-40, 10, -120, 5), np.zeros(1), np.ones(1, bool))[0] == -4.0


def test_beliefs_are_the_filters_and_of_others_the_stated_shares():
    seen = one(-60, 18, -58, 17)
    driver = HostDriver(Interactive(), Rollout())
    driver.start(1, Setting(LIMIT))
    driver.reset(np.arange(1), np.zeros(1, np.int64), np.zeros(1, np.uint64))
    driver.decide(seen)
    np.testing.assert_array_equal(driver.controller.last_belief, driver.estimator.beliefs)
    other = HostDriver(AccMerging(), Rollout(ignore_share=0.2))
    other.start(1, Setting(LIMIT))
    other.decide(seen)
    np.testing.assert_allclose(other.controller.last_belief, [[0.0, 0.8, 0.2, 0.0, 0.0, 0.0]])


def test_after_the_merge_the_law_of_acc_drives():
    from merge_cosim.controllers.acc import Acc as Law

    seen, law = one(-10, 20, 5, 15), Law()
    law.start(1, Setting(LIMIT))
    target = np.ones(1, bool)
    np.testing.assert_array_equal(
        planner(escape=False).command(seen, np.zeros(1), target), law.command(seen, np.zeros(1), target)
    )


@pytest.mark.parametrize(
    ("state", "then", "holds"),
    [
        ((-60, 20, -60, 20), -4.0, True),  # stops after 50 m
        ((-45, 20, -45, 20), -4.0, False),  # cannot stop, and the driver may be anywhere
        ((-10, 20, -80, 20), 2.0, True),  # through before the driver comes
        ((-10, 20, -14, 20), 2.0, False),  # the driver can be beside
        ((-30, 20, -1, 28), -4.0, True),  # ahead, and faster than the host whatever it does
        ((1, 27, -2, 20), 2.0, False),  # past the point, but the driver comes into the lane beside
        ((5, 27, -2, 20), 2.0, True),  # past it and clear
        ((-0.0005, 0.01, 1, 2), -4.0, True),  # stands just before the point
    ],
)
def test_escapes_by_hand(state, then, holds):
    assert escapes(then, then, column(*state), *FULL, TOLERANCE, BOUNDS) == holds


@pytest.mark.parametrize(
    ("state", "then", "off", "holds"),
    [
        ((5, 27, -2, 20), 2.0, (0.0, 0.0, 0.0), True),  # its rear 2 m past the driver, who gains at most 2.4 m on it
        ((5, 27, -2, 20), 2.0, (1.5, 0.0, 0.0), False),  # the driver may be 3 m further on
        ((5, 27, -2, 20), 2.0, (0.0, 0.0, 3.0), False),  # the same, for reports are old
        ((-10, 20, -20, 20), 2.0, (0.0, 0.0, 0.0), True),  # through first, and the driver can brake
        ((-10, 20, -20, 20), 2.0, (0.0, 2.0, 0.0), False),  # the driver may be 4 m/s faster
        ((-60, 20, -60, 20), -4.0, (9.0, 9.0, 0.0), True),  # a stop does not depend on the driver
    ],
)
def test_an_escape_must_hold_for_states_two_deviations_off(state, then, off, holds):
    assert escapes(then, then, column(*state, off=off), *FULL, TOLERANCE, BOUNDS) == holds


@pytest.mark.parametrize(
    ("host", "merging", "speed", "waits"),
    [
        (-0.002, -0.1, 0.0, True),  # level with it
        (6.8, -0.1, 0.0, True),  # its rear is not yet 2 m past
        (7.0, -0.1, 0.0, False),
        (-0.2, -0.1, 0.0, False),  # behind it: the driver may go first
        (-0.002, -0.1, 0.2, False),  # it moves
        (-2.0, -2.1, 0.0, False),  # not at the merging point
        (5.0, 0.0, 0.0, False),  # in the lane
    ],
)
def test_a_driver_who_stands_beside_the_host_waits_for_it(host, merging, speed, waits):
    """Standing keeps an escape, and so would every driver's start be guarded against: both would wait for ever."""
    assert waits_beside(host, 5.0, merging, speed, 2.0) == waits
    if waits:
        assert kept(2.0, column(host, 0.0, merging, speed), *FULL, BOUNDS._replace(past=2.0))


def test_only_the_strict_guarantee_waits_beside_a_standing_driver():
    state = -0.002, 0.0, -0.1, 0.0
    assert guarded(planner(), state)._last[0] > 1.0
    assert guarded(planner(tolerated_risk=0.0), state)._last[0] <= 0.0


def test_a_new_command_stops_a_millimetre_before_the_merging_point():
    state = column(-0.0005, 0.0, -0.0005, 0.0)
    assert not kept(0.0, state, *FULL, BOUNDS)
    assert escapes(-4.0, -4.0, state, *FULL, TOLERANCE, BOUNDS)


def test_bounds_are_narrowed_around_what_is_expected():
    assert narrowed(1.0, 0.7, BOUNDS) == pytest.approx((-4.0, 3.0))
    assert narrowed(0.25, 1.0, BOUNDS) == pytest.approx((-0.25, 1.5))


def guarded(made, state):
    """The planner after one cycle."""
    made.command(one(*state), np.zeros(1), np.ones(1, bool))
    return made


def test_where_no_escape_is_left_the_bounds_are_narrowed_and_then_an_overlap_weighs_more():
    """Side by side at 27 m/s nothing helps against all that a driver may do, much against what it is likely to do."""
    made = guarded(planner(tolerated_risk=0.0), (-73, 27.2, -67, 23.6))
    assert 0.0 < made.escape_share[0] < 1.0
    assert made.escape_status[0] in (LEFT, FORCED)
    lost = guarded(planner(tolerated_risk=0.0), (-10, 20, -9, 20))
    assert lost.escape_share[0] == 0.0
    assert lost.escape_status[0] == NONE
    light = guarded(planner(tolerated_risk=0.0, last_overlap=0.0), (-10, 20, -9, 20))
    assert lost.risk[0] <= light.risk[0]


def test_a_small_risk_is_tolerated():
    state = -60, 18, -58, 17
    assert guarded(planner(tolerated_risk=1.0), state).escape_status[0] == UNSEEN
    assert guarded(planner(tolerated_risk=0.0), state).escape_status[0] != UNSEEN


def test_a_risk_is_forgotten_with_its_time_constant():
    for memory, forgotten in ((0.0, 1), (0.3, 7)):  # 8 exp(-0.1 k / 0.3) is below 1 from k = 7 on
        made = guarded(planner(risk_memory=memory), (-60, 18, -58, 17))
        made.tolerated_risk = made.risk[0] / 8.0
        looked = [guarded(made, (-60, 25, -58, 0)).escape_status[0] != UNSEEN for _ in range(9)]
        assert made.risk[0] < made.tolerated_risk
        assert looked == [cycle < forgotten for cycle in range(1, 10)]


stations, speeds = st.floats(-90, -1), st.floats(0, 28)
accelerations = st.lists(st.floats(-4, 3), min_size=30, max_size=30)


@settings(max_examples=75, deadline=None)
@given(stations, speeds, stations, speeds, accelerations)
def test_an_escape_that_exists_at_the_start_avoids_the_overlap_whatever_the_driver_does(s_h, v_h, s_m, v_m, driven):
    """Until the end: the driver does anything, but brakes once it has been behind in the lane for the reaction time."""
    made = planner(tolerated_risk=0.0)
    existed, in_lane = False, 0.0
    for k in range(150):
        if min(s_h, s_m) >= 0:
            gap = s_m - 5.0 - s_h if s_m >= s_h else s_h - 5.0 - s_m
            assert gap >= -1e-6 or not existed
        command = made.command(one(s_h, v_h, s_m, v_m), np.zeros(1), np.zeros(1, bool))[0]
        existed = existed or made.escape_share[0] == 1.0
        if existed and not (s_m >= 0 and s_h > s_m):
            assert made.escape_share[0] == 1.0
            assert kept(command, column(s_h, v_h, s_m, v_m), *FULL, BOUNDS)
        a = driven[k % 30]
        if s_m >= 0 and s_h > s_m:
            a = -3.0 if in_lane >= 0.3 - 1e-9 else a
            in_lane += 0.1
        v_h, v_m = min(max(v_h + command * 0.1, 0.0), LIMIT), min(max(v_m + a * 0.1, 0.0), LIMIT)
        s_h, s_m = s_h + v_h * 0.1, s_m + v_m * 0.1

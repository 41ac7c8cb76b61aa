"""iPCB's planner: the cost of a candidate against a plain loop, and what it drives."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.pcb import Pcb
from merge_cosim.core.observation import Observation, Setting

LIMIT = 29.0


def seen(host, merging, lengths=(5.0, 5.0)):
    def one(value):
        return np.array([float(value)])

    return Observation(*map(one, (*host, *merging, *lengths)))


def ready(controller):
    controller.start(1, Setting(speed_limit=LIMIT))
    return controller


def looped_cost(candidate, host, merging, lengths, intended):
    """One candidate's cost as the definition says it, step by step."""
    (s_h, v_h), (s_m, v_m), (length_h, length_m) = host, merging, lengths
    slow, close, overlap = 0.0, 0.0, False
    for _ in range(12):
        v_h += candidate * 0.5
        s_h += 0.5 * min(max(v_h, 0.0), LIMIT)
        if s_m < -1e-6:
            v_m += intended * 0.5
        s_m += 0.5 * min(max(v_m, 0.0), LIMIT)
        slow += (LIMIT - min(max(v_h, 0.0), LIMIT)) / LIMIT / 12
        if min(s_h, s_m) >= -1e-6:
            gap = s_h - length_h - s_m if s_h - length_h / 2 > s_m - length_m / 2 else s_m - length_m - s_h
            close = max(close, math.exp(-max(gap, 0.0) / 5))
            overlap = overlap or gap < -1e-6
    return slow + 0.1 * (candidate / 4) ** 2 + 10 * close + 1000 * overlap


def test_candidates():
    np.testing.assert_allclose(ready(Pcb()).candidates, np.arange(-8, 5) / 2)
    np.testing.assert_allclose(ready(Pcb(max_acceleration=1.0, candidate_step=1.0)).candidates, [-4, -3, -2, -1, 0, 1])


def test_cost_of_one_candidate_by_hand():
    # both at 10 m/s for 6 s: host from -20 m to 40 m, merging car from -30 m at mu = 0 to 30 m, 5 m between them
    controller = ready(Pcb(mean_yield=0.0, mean_not_yield=0.0))
    cost = controller.costs(seen((-20, 10), (-30, 10)))[:, 8, 0]
    assert controller.candidates[8] == 0.0
    np.testing.assert_allclose(cost, 19 / 29 + 10 * math.exp(-1))
    # level with each other they overlap
    np.testing.assert_allclose(controller.costs(seen((-20, 10), (-20, 10)))[:, 8, 0], 19 / 29 + 10 + 1000)
    # and upstream of the merging point nothing counts
    np.testing.assert_allclose(controller.costs(seen((-90, 10), (-90, 10)))[:, 8, 0], 19 / 29)


state = st.tuples(st.floats(-120, 5), st.floats(0, 30))


@settings(max_examples=150)
@given(host=state, merging=state, lengths=st.tuples(st.floats(3, 15), st.floats(3, 15)), means=st.booleans())
def test_costs_are_those_of_a_plain_loop(host, merging, lengths, means):
    controller = ready(Pcb(means="arrival" if means else "fixed"))
    now = seen(host, merging, lengths)
    cost = controller.costs(now)
    for intention, intended in enumerate(controller.intended(now, 0.1)[:, 0].tolist()):
        expected = [looped_cost(a, host, merging, lengths, intended) for a in controller.candidates.tolist()]
        np.testing.assert_allclose(cost[intention, :, 0], expected, rtol=1e-9, atol=1e-9)


def test_drives_the_cheapest_in_expectation():
    controller = ready(Pcb())
    now = seen((-60, 14), (-62, 13))
    cost = controller.costs(now)[:, :, 0]
    for log_odds in (-np.inf, -900.0, -1.0, 0.0, 2.0, np.inf):
        p = 1.0 if log_odds == np.inf else math.exp(log_odds) / (1 + math.exp(log_odds))
        expected = (1 - p) * cost[0] + p * cost[1]
        command = controller.command(now, np.array([log_odds]), np.array([log_odds >= 0]))
        assert command[0] == controller.candidates[expected.argmin()]


def test_believes_the_given_log_odds():
    # level and as fast: it goes before one who yields and lets one pass who does not
    controller, now = ready(Pcb()), seen((-60, 12), (-60, 12))
    command = [controller.command(now, np.array([odds]), np.array([odds > 0]))[0] for odds in (-np.inf, np.inf)]
    assert command[0] > 0 > command[1]


@pytest.mark.parametrize("target", [True, False])
def test_in_the_lane_acc_drives(target):
    now = seen((-20, 12), (3, 12))
    arguments = now, np.array([5.0]), np.array([target])
    assert ready(Pcb()).command(*arguments) == ready(Acc()).command(*arguments)


def test_batch_of_one_and_of_many_agree_to_the_bit():
    rng = np.random.default_rng(0)
    n = 96
    station, speed, length = rng.uniform(-90, 3, (2, n)), rng.uniform(0, 29, (2, n)), rng.uniform(4, 12, (2, n))
    controller, odds = Pcb(means="arrival"), rng.normal(0, 3, n)
    controller.start(n, Setting())
    whole = controller.costs(Observation(station[0], speed[0], station[1], speed[1], *length))
    commands = controller.command(Observation(station[0], speed[0], station[1], speed[1], *length), odds, odds > 0)
    for i in range(n):
        one = Observation(*(a[i : i + 1] for a in (station[0], speed[0], station[1], speed[1], *length)))
        np.testing.assert_array_equal(controller.costs(one)[:, :, 0], whole[:, :, i])
        assert controller.command(one, odds[i : i + 1], odds[i : i + 1] > 0)[0] == commands[i]

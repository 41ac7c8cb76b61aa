"""PGM: tables against hand counts, the incremental sum against the direct one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merge_cosim.errors import UserError
from merge_cosim.intention.model import SPEED_BINS, TIME_BINS, IntentionModel, speed_bin, time_bin
from merge_cosim.intention.pgm import Pgm, PgmTime
from merge_cosim.observation import Observation, Setting


def small_model() -> IntentionModel:
    transitions = np.zeros((2, SPEED_BINS, SPEED_BINS), dtype=np.int64)
    transitions[0, 10, [9, 10]] = [3, 1]
    transitions[1, 10, [10, 11]] = [1, 3]
    transitions[0, 20, 20] = 5  # seen under YIELD only
    arrivals = np.zeros((2, TIME_BINS, TIME_BINS))
    arrivals[0, 10, 4] = 2.0
    arrivals[1, 4, 10] = 1.0
    return IntentionModel(
        name="small",
        site="us101",
        source="ngsim",
        trained_on=("us101/a/1/1",),
        settings={},
        pairs=np.array([2, 1]),
        merge_speed=12.5,
        transitions={1: transitions},
        arrivals=arrivals,
    )


def seen(speed, merging=-50.0, host=-50.0, host_speed=10.0):
    speed = np.atleast_1d(np.asarray(speed, dtype=float))
    n = len(speed)
    return Observation(
        np.full(n, host), np.full(n, host_speed), np.full(n, merging), speed, np.full(n, 5.0), np.full(n, 5.0)
    )


def test_transition_probabilities_by_hand():
    without_background = small_model().speed_probabilities(1, epsilon=0.0)
    np.testing.assert_allclose(without_background[0, 10, 9:12], [0.75, 0.25, 0.0])
    np.testing.assert_allclose(without_background[1, 10, 9:12], [0.0, 0.25, 0.75])
    mixed = small_model().speed_probabilities(1, epsilon=0.05)
    background = small_model().speed_probabilities(1, epsilon=1.0)
    np.testing.assert_allclose(mixed[0, 10], 0.95 * without_background[0, 10] + 0.05 * background[0, 10])
    np.testing.assert_allclose(mixed[:, 10].sum(axis=1), 1.0)


def test_a_row_that_one_intention_never_saw_says_nothing():
    model = small_model()
    assert np.all(model.speed_log_odds(1, 0.05)[20] == 0.0)
    assert np.all(model.speed_log_odds(1, 0.05)[35] == 0.0)


def test_time_probabilities_sum_to_one_and_peak_where_counted():
    both = small_model().time_probabilities(0.05)
    np.testing.assert_allclose(both.sum(axis=(1, 2)), 1.0)
    assert np.unravel_index(both[0].argmax(), both[0].shape) == (10, 4)
    assert small_model().time_log_odds(0.05)[4, 10] > 0 > small_model().time_log_odds(0.05)[10, 4]


def test_prior():
    assert small_model().prior_log_odds == pytest.approx(np.log(1 / 2))


def test_one_node_is_time_and_prior():
    model, estimator = small_model(), PgmTime()
    estimator.use(model)
    estimator.start(1, Setting())
    estimator.reset(np.array([0]), np.array([0]), np.zeros(1, dtype=np.uint64))
    now = seen(10.0)
    table = model.time_log_odds(0.05)
    expected = table[time_bin(now.merging_arrival), time_bin(now.host_arrival)] + model.prior_log_odds
    for _ in range(3):
        np.testing.assert_array_equal(estimator.update(now), expected)


@settings(max_examples=40, deadline=None)
@given(
    speeds=st.lists(st.floats(0, 30), min_size=1, max_size=80),
    nodes=st.integers(1, 60),
    lag=st.sampled_from([1, 5, 10]),
)
def test_the_running_sum_is_the_direct_sum(speeds, nodes, lag):
    model = IntentionModel.load("us101-ngsim")
    estimator = Pgm(nodes=nodes, transition_lag=lag, time_weight=0.0)
    estimator.use(model)
    estimator.start(1, Setting())
    estimator.reset(np.array([0]), np.array([0]), np.zeros(1, dtype=np.uint64))
    table = model.speed_log_odds(lag, 0.05) / lag
    bins = speed_bin(np.array(speeds))
    for t, speed in enumerate(speeds):
        got = estimator.update(seen(speed))[0]
        transitions = [table[bins[i - lag], bins[i]] for i in range(lag, t + 1)]
        window = transitions[-(nodes - 1) :] if nodes > 1 else []
        first_allowed = max(0, len(transitions) - len(window))
        # while fewer cycles than the window have passed, all transitions so far count
        expected = sum(transitions[first_allowed:]) + model.prior_log_odds
        assert got == pytest.approx(expected, abs=1e-9)


def test_a_model_survives_its_file(tmp_path):
    model = small_model()
    model.save(tmp_path / "m.json")
    again = IntentionModel.load(tmp_path / "m.json")
    np.testing.assert_array_equal(again.transitions[1], model.transitions[1])
    np.testing.assert_allclose(again.arrivals, model.arrivals)
    assert replace(again, transitions={}, arrivals=None, pairs=None) == replace(
        model, transitions={}, arrivals=None, pairs=None
    )
    json.loads((tmp_path / "m.json").read_text())


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"schema": 99}', "not json"])
def test_what_is_no_model_is_refused_by_name(tmp_path, text):
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(UserError, match=r"bad\.json"):
        IntentionModel.load(file)


def test_a_missing_lag_is_refused():
    with pytest.raises(UserError, match="transition_lag 5"):
        Pgm(transition_lag=5).use(small_model())

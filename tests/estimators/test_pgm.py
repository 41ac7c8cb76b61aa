"""PGM: time, prior and the running sum of its speed term."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small import begin, seen, small_model

from merge_cosim.estimators.learned.histogram import speed_bin, time_bin
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.pgm import Pgm, PgmSymmetric, PgmTime


def test_one_node_is_time_and_prior():
    model = small_model()
    estimator = begin(PgmTime(), model)
    now = seen(10.0)
    table = model.arrivals.log_odds(0.05)
    expected = table[time_bin(now.merging_arrival), time_bin(now.host_arrival)] + model.prior_log_odds
    for _ in range(3):
        np.testing.assert_array_equal(estimator.update(now), expected)


@settings(max_examples=40)
@given(
    speeds=st.lists(st.floats(0, 30), min_size=1, max_size=80),
    nodes=st.integers(1, 60),
    lag=st.sampled_from([1, 5, 10]),
)
def test_the_running_sum_is_the_direct_sum(speeds, nodes, lag):
    model = IntentionModel.load("us101-ngsim")
    estimator = begin(Pgm(nodes=nodes, transition_lag=lag, time_weight=0.0), model)
    table = model.speed(lag).histogram.with_background(0.05).log_odds / lag
    bins = speed_bin(np.array(speeds))
    for t, speed in enumerate(speeds):
        got = estimator.update(seen(speed))[0]
        transitions = [table[bins[i - lag], bins[i]] for i in range(lag, t + 1)]
        window = transitions[-(nodes - 1) :] if nodes > 1 else []
        first_allowed = max(0, len(transitions) - len(window))
        # while fewer cycles than the window have passed, all transitions so far count
        expected = sum(transitions[first_allowed:]) + model.prior_log_odds
        assert got == pytest.approx(expected, abs=1e-9)


def test_symmetric_roles_leave_ties_open():
    estimator = begin(PgmSymmetric(alpha=0.0), IntentionModel.load("us101-ngsim"))
    tie = seen(10.0)
    assert estimator.update(tie).tolist() == [0.0]

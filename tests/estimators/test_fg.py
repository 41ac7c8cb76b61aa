"""FG and FG-GMM: the fading sum, the last intention and the prior, by hand and against the direct sum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import expit
from small import begin, seen, small_histogram, small_mixture, small_model

from merge_cosim.estimators.fg import Fg, FgGmm, FgGmmJoint, FgTime
from merge_cosim.estimators.learned.histogram import time_bin
from merge_cosim.estimators.learned.model import IntentionModel

PRIOR = np.log(1 / 2)


def test_the_first_cycles_by_hand():
    estimator = begin(Fg(), small_model())
    # nothing seen yet: the prior, and the prior again as the last intention, P(N) = 1/3
    first = PRIOR + (2 / 3 - 1)
    assert estimator.update(seen(10.5))[0] == pytest.approx(first)
    up = small_histogram().with_background(0.05).log_odds[10, 11]
    second = up + (2 * expit(first) - 1) + PRIOR
    assert estimator.update(seen(11.5))[0] == pytest.approx(second)
    # 11 -> 11 was never seen by either: it says nothing, and what was said fades
    assert small_histogram().with_background(0.05).log_odds[11, 11] == 0.0
    third = np.exp(-0.1) * up + (2 * expit(second) - 1) + PRIOR
    assert estimator.update(seen(11.5))[0] == pytest.approx(third)


def test_every_parameter_is_where_the_equation_has_it():
    estimator = begin(Fg(forgetting=0.5, last_weight=3.0, last_variance=2.0, frames=1), small_model())
    first = PRIOR + 1.5 * (2 / 3 - 1)
    assert estimator.update(seen(10.5))[0] == pytest.approx(first)
    up = small_histogram().with_background(0.05).log_odds[10, 11]
    second = up + 1.5 * (2 * expit(first) - 1) + PRIOR
    assert estimator.update(seen(11.5))[0] == pytest.approx(second)
    third = 1.5 * (2 * expit(second) - 1) + PRIOR  # one frame: what was said before is dropped
    assert estimator.update(seen(11.5))[0] == pytest.approx(third)


def test_missing_cells_by_neighbours():
    estimator = begin(Fg(missing="neighbours", last_weight=0.0), small_model())
    estimator.update(seen(10.5))
    assert estimator.update(seen(11.5))[0] == pytest.approx(np.log(0.75 / (0.25 / 8)) + PRIOR)


@pytest.mark.parametrize(("cls", "density"), [(FgGmm, "conditional"), (FgGmmJoint, "joint")])
def test_the_mixture_stands_for_f(cls, density):
    estimator = begin(cls(last_weight=0.0), small_model())
    estimator.update(seen(10.5))
    expected = small_mixture().log_ratio(np.array([10.5]), np.array([10.8]), density)[0] + PRIOR
    assert estimator.update(seen(10.8))[0] == pytest.approx(expected)


def test_only_the_variant_sees_the_host():
    model = small_model()
    far, near = seen(10.5, host=-90.0), seen(10.5, host=-20.0)
    assert begin(Fg(), model).update(far) == begin(Fg(), model).update(near)
    table = model.arrivals.log_odds(0.05)
    for now in (far, near):
        time = table[time_bin(now.merging_arrival), time_bin(now.host_arrival)][0]
        assert begin(FgTime(), model).update(now)[0] == pytest.approx(begin(Fg(), model).update(now)[0] + time)


@settings(max_examples=40)
@given(
    speeds=st.lists(st.floats(5, 25), min_size=1, max_size=80),
    frames=st.integers(1, 30),
    forgetting=st.sampled_from([0.0, 0.1, 1.0]),
    lag=st.sampled_from([1, 5]),
    mixture=st.booleans(),
)
def test_the_recursion_is_the_direct_sum(speeds, frames, forgetting, lag, mixture):
    model = IntentionModel.load("us101-ngsim")
    options = {"frames": frames, "forgetting": forgetting, "transition_lag": lag}
    estimator = begin(FgGmm(**options) if mixture else Fg(**options), model)
    learned = model.speed(lag)
    f = learned.mixture if mixture else learned.histogram.with_background(0.05)
    v = np.array(speeds)
    believed = expit(model.prior_log_odds)
    terms = np.zeros(len(v))
    terms[lag:] = f.log_ratio(v[:-lag], v[lag:]) / lag if len(v) > lag else 0.0
    for t in range(len(v)):
        s = sum(np.exp(-forgetting * i) * terms[t - i] for i in range(min(frames, t + 1)))
        expected = s + (2 * believed - 1) + model.prior_log_odds
        got = estimator.update(seen(v[t]))[0]
        assert got == pytest.approx(expected, rel=1e-9, abs=1e-9)
        believed = expit(got)

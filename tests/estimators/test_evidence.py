"""The running sum against the direct one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from merge_cosim.estimators.evidence import SpeedEvidence


def ratio(before, now):
    return np.sin(before) + 3.0 * np.cos(now)


@settings(max_examples=60)
@given(
    speeds=st.lists(st.floats(0, 30), min_size=1, max_size=150),
    lag=st.sampled_from([1, 2, 5, 10]),
    window=st.integers(1, 60),
    keep=st.sampled_from([1.0, float(np.exp(-0.1)), 0.5]),
)
def test_the_running_sum_is_the_direct_sum(speeds, lag, window, keep):
    evidence = SpeedEvidence(ratio, lag, window, keep)
    evidence.start(1)
    v = np.array(speeds)
    terms = np.where(np.arange(len(v)) >= lag, ratio(np.roll(v, lag), v) / lag, 0.0)
    for t in range(len(v)):
        direct = sum(keep**i * terms[t - i] for i in range(min(window, t + 1)))
        assert evidence.add(v[t : t + 1])[0] == pytest.approx(direct, abs=1e-9)


@settings(max_examples=30)
@given(begin=st.integers(0, 40), lag=st.sampled_from([1, 5]), window=st.integers(1, 20))
def test_a_driver_who_begins_later_is_the_same_driver(begin, lag, window):
    """Rings are shared, so where a driver begins in them must not matter."""
    speeds = np.random.default_rng(begin).uniform(0, 30, 40)
    alone, beside = SpeedEvidence(ratio, lag, window, 0.9), SpeedEvidence(ratio, lag, window, 0.9)
    alone.start(1)
    beside.start(2)
    for t in range(begin):
        beside.add(np.array([3.0 * t, t]))
    beside.reset(np.array([1]))
    for speed in speeds:
        assert beside.add(np.array([1.0, speed]))[1] == alone.add(np.array([speed]))[0]

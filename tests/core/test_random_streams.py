"""Random streams: known values, the right distributions, independence of the batch."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from merge_cosim.core.random_streams import derived_keys, normal, stream_keys, uniform


def test_splitmix64_gives_its_published_sequence():
    # the first outputs of SplitMix64 seeded with 1234567, as in its reference implementation
    expected = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    numbers = uniform(np.array([1234567], dtype=np.uint64), np.array([0]), 3)[0]
    np.testing.assert_array_equal(numbers, [((e >> 11) + 0.5) * 2.0**-53 for e in expected])


@given(st.integers(0, 2**62), st.integers(0, 1000), st.integers(1, 20))
def test_a_stream_is_the_same_wherever_it_stands(seed, first, count):
    keys = stream_keys(np.array(["a", "b", "c"]), seed)
    at = np.array([first, first + 3, first])
    whole = uniform(keys, at, count)
    np.testing.assert_array_equal(whole[1:2], uniform(keys[1:2], at[1:2], count))
    np.testing.assert_array_equal(whole[0], uniform(keys[:1], np.array([0]), first + count)[0, first:])
    assert ((whole > 0) & (whole < 1)).all()


def test_streams_are_distributed_as_they_should_be():
    keys = stream_keys(np.array([f"case-{i}" for i in range(200)]), 7)
    start = np.zeros(200, dtype=np.int64)
    assert kstest(uniform(keys, start, 500).ravel(), "uniform").pvalue > 0.001
    assert kstest(uniform(keys, start, 1).ravel(), "uniform").pvalue > 0.001  # across streams
    drawn = normal(keys, start, 500)
    assert kstest(drawn.ravel(), "norm").pvalue > 0.001
    assert np.corrcoef(drawn[:-1].ravel(), drawn[1:].ravel())[0, 1] == pytest.approx(0.0, abs=0.02)


def test_derived_streams_are_streams_of_their_own():
    keys = stream_keys(np.array([f"case-{i}" for i in range(200)]), 7)
    start = np.zeros(200, dtype=np.int64)
    drawn = [uniform(one, start, 500) for one in (keys, derived_keys(keys, "a"), derived_keys(keys, "b"))]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        assert np.corrcoef(drawn[one].ravel(), drawn[other].ravel())[0, 1] == pytest.approx(0.0, abs=0.02)
    assert kstest(drawn[1].ravel(), "uniform").pvalue > 0.001
    np.testing.assert_array_equal(derived_keys(keys, "a")[3:4], derived_keys(keys[3:4], "a"))


def test_seed_and_name_make_the_key():
    a, b = stream_keys(np.array(["x", "y"]), 0)
    assert len({int(a), int(b), int(stream_keys(np.array(["x"]), 1)[0])}) == 3

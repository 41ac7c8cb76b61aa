"""Low-variance resampling, clouds and their random streams."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from merge_cosim.core.random_streams import normal, stream_keys, uniform
from merge_cosim.estimators.particles import Cloud, Dice, low_variance


def by_walking(weights, start, count):
    """The textbook's loop: walk along the wheel with a comb of `count` teeth."""
    total, chosen, i, reached = sum(weights), [], 0, weights[0]
    for j in range(count):
        tooth = (start + j) / count * total
        while tooth >= reached and i < len(weights) - 1:
            i += 1
            reached += weights[i]
        chosen.append(i)
    return chosen


def test_by_hand():
    # teeth at 0.125, 0.375, 0.625, 0.875 against the cumulative weights 0.5, 0.5, 0.75, 1
    drawn = low_variance(np.array([[0.5, 0.0, 0.25, 0.25]]), np.array([0.5]), 4)
    np.testing.assert_array_equal(drawn, [[0, 0, 2, 3]])
    np.testing.assert_array_equal(low_variance(np.array([[0.0, 3.0, 0.0]]), np.array([0.9]), 3), [[1, 1, 1]])
    assert low_variance(np.array([[1.0, 1.0]]), np.array([0.5]), 0).shape == (1, 0)


batches = st.tuples(st.integers(1, 5), st.integers(1, 40)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=st.floats(0, 1, allow_subnormal=False))
)


@settings(max_examples=200)
@given(weights=batches, start=st.floats(1e-6, 1 - 1e-6), count=st.integers(1, 60))
def test_every_particle_is_drawn_within_one_of_its_share(weights, start, count):
    weights[:, 0] += 0.01
    drawn = low_variance(weights, np.full(len(weights), start), count)
    assert drawn.shape == (len(weights), count)
    assert (np.diff(drawn, axis=1) >= 0).all()
    for row, chosen in zip(weights, drawn, strict=True):
        copies = np.bincount(chosen, minlength=len(row))
        share = count * row / row.sum()
        assert (np.abs(copies - share) < 1 + 1e-9).all()
        assert (copies[row == 0] == 0).all()


def test_agrees_with_the_loop_of_the_textbook():
    rng = np.random.default_rng(0)
    weights, start = rng.exponential(size=(50, 200)), rng.uniform(size=50)
    drawn = low_variance(weights, start, 190)
    for i in range(50):
        np.testing.assert_array_equal(drawn[i], by_walking(weights[i].tolist(), start[i], 190))
        np.testing.assert_array_equal(low_variance(weights[i : i + 1], start[i : i + 1], 190)[0], drawn[i])


def test_each_encounter_has_its_own_counter():
    keys = stream_keys(np.array(["a", "b", "c"]), 0)
    dice = Dice(3)
    dice.reset(np.arange(3), keys)
    dice.uniform(np.array([1]), 7)
    both = dice.normal(np.array([0, 1]), 4)
    np.testing.assert_array_equal(both[0], normal(keys[:1], np.array([0]), 4)[0])
    np.testing.assert_array_equal(both[1], normal(keys[1:2], np.array([7]), 4)[0])
    dice.reset(np.array([1]), keys[2:])
    np.testing.assert_array_equal(dice.uniform(np.array([1]), 2)[0], uniform(keys[2:], np.array([0]), 2)[0])


def test_clouds_are_taken_and_put_row_by_row():
    cloud = Cloud(*(np.arange(6).reshape(2, 3) + offset for offset in (0.0, 10.0)), np.array([[0, 1, 2], [2, 1, 0]]))
    room = Cloud.empty(3, 3)
    room.put(np.array([2, 0]), cloud)
    np.testing.assert_array_equal(room.take(np.array([0])).station, cloud.station[1:])
    assert room.station[1] == pytest.approx(0.0)

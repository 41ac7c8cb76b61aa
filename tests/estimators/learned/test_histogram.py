"""Counted transitions and times to arrival, against hand counts."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from small import small_histogram, small_model

from merge_cosim.estimators.learned.histogram import (
    SPEED_BINS,
    TIME_BINS,
    ArrivalHistogram,
    SpeedHistogram,
    blurred,
    speed_bin,
    time_bin,
)


def test_bins_end_where_the_table_does():
    np.testing.assert_array_equal(speed_bin(np.array([-1.0, 0.0, 0.999, 1.0, 25.0, 99.0])), [0, 0, 0, 1, 25, 39])
    np.testing.assert_array_equal(time_bin(np.array([0.0, 0.49, 0.5, 14.9, 400.0])), [0, 0, 1, 29, 29])


def test_transitions_are_counted_by_intention():
    counts = SpeedHistogram.fit(np.array([10.2, 10.9, 10.1]), np.array([10.8, 11.1, 11.9]), np.array([0, 1, 1])).counts
    assert counts[0, 10, 10] == 1
    assert counts[1, 10, 11] == 2
    assert counts.sum() == 3


def test_background_by_hand():
    plain = small_histogram().with_background(0.0).probabilities
    np.testing.assert_allclose(plain[0, 10, 9:12], [0.75, 0.25, 0.0])
    np.testing.assert_allclose(plain[1, 10, 9:12], [0.0, 0.25, 0.75])
    mixed = small_histogram().with_background(0.05).probabilities
    background = small_histogram().with_background(1.0).probabilities
    np.testing.assert_allclose(mixed[0, 10], 0.95 * plain[0, 10] + 0.05 * background[0, 10])
    np.testing.assert_allclose(mixed[:, 10].sum(axis=1), 1.0)


def test_a_row_that_one_intention_never_saw_says_nothing():
    table = small_histogram().with_background(0.05)
    assert np.all(table.log_odds[20] == 0.0)
    assert np.all(table.log_odds[35] == 0.0)


def test_neighbours_by_hand():
    table = small_histogram().with_neighbours()
    yields, goes = table.probabilities
    np.testing.assert_allclose(yields[10, [9, 10]], [0.75, 0.25])  # what was counted stays
    assert yields[10, 8] == pytest.approx(0.75 / 8)  # beside the 0.75 alone
    assert yields[11, 9] == pytest.approx((0.75 + 0.25) / 8)
    assert goes[10, 9] == pytest.approx(0.25 / 8)
    assert table.log_odds[10, 9] == pytest.approx(np.log(0.25 / 8 / 0.75))
    assert table.log_odds[10, 11] == pytest.approx(np.log(0.75 / (0.25 / 8)))
    assert table.log_odds[20, 20] == 0.0  # NOT_YIELD knows nothing near it
    ratio = table.log_ratio(np.array([10.5, 10.5]), np.array([9.5, 11.5]))
    np.testing.assert_array_equal(ratio, table.log_odds[[10, 10], [9, 11]])


def test_neighbours_at_the_edge_are_fewer():
    counts = np.zeros((2, SPEED_BINS, SPEED_BINS), dtype=np.int64)
    counts[:, 0, 1] = 4
    assert SpeedHistogram(counts).with_neighbours().probabilities[0, 0, 0] == pytest.approx(1 / 3)
    assert SpeedHistogram(counts).with_neighbours().probabilities[0, 1, 0] == pytest.approx(1 / 5)


def test_density_is_probability_per_metre_per_second():
    table = small_histogram().with_background(0.0)
    logs = table.log_density(np.array([10.5, 10.5]), np.array([9.5, 11.5]))
    np.testing.assert_allclose(logs, [[np.log(0.75), -np.inf], [-np.inf, np.log(0.75)]])


def test_time_probabilities_sum_to_one_and_peak_where_counted():
    arrivals = small_model().arrivals
    both = arrivals.probabilities(0.05)
    np.testing.assert_allclose(both.sum(axis=(1, 2)), 1.0)
    assert np.unravel_index(both[0].argmax(), both[0].shape) == (10, 4)
    assert arrivals.log_odds(0.05)[4, 10] > 0 > arrivals.log_odds(0.05)[10, 4]


def filled(*cells):
    shares = np.zeros((2, TIME_BINS, TIME_BINS))
    for intention, merging, host in cells:
        shares[intention, merging, host] = 1.0
    return ArrivalHistogram(shares)


def test_cells_far_from_every_filled_one_say_nothing():
    arrivals = filled((0, 4, 10), (1, 10, 4))
    odds = arrivals.log_odds(0.05)
    assert odds[4, 12] < 0 < odds[12, 4]  # two bins away
    assert odds[4, 13] == odds[20, 20] == 0.0
    inside = arrivals.supports(np.array([2.0, 2.0, 400.0]), np.array([6.4, 6.5, 400.0]))
    assert inside.tolist() == [True, False, False]


def test_the_last_bin_is_open():
    arrivals = filled((0, 4, 29), (1, 29, 4))
    assert arrivals.log_odds(0.05)[time_bin(np.array([2.0])), time_bin(np.array([40.0]))] < 0
    assert arrivals.supports(np.array([2.0]), np.array([1e9])).all()


def test_with_the_roles_swapped_equal_times_say_nothing():
    odds = filled((0, 4, 10), (0, 5, 5), (1, 6, 3)).symmetric().log_odds(0.05)
    np.testing.assert_allclose(odds, -odds.T, atol=1e-12)
    assert (np.diag(odds) == 0.0).all()
    assert odds[4, 10] < 0 < odds[10, 4]


def test_smoothing_is_that_of_scipy_to_the_last_bit():
    counts = np.random.default_rng(0).poisson(0.7, (30, 40)).astype(float)
    assert np.array_equal(blurred(counts), gaussian_filter(counts, sigma=1.0, mode="constant"))

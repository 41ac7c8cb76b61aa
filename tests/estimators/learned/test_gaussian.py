"""Gaussian changes of speed, by hand and against scipy."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm
from small import small_gaussian

from merge_cosim.estimators.learned.gaussian import ENOUGH, WIDE_BINS, SpeedGaussian


def test_log_ratio_by_hand():
    # V 12.0 -> 12.1: under N(12.3, 0.1) two sigma off, under N(11.9, 0.2) one sigma off
    by_hand = (-np.log(0.1) - 2.0) - (-np.log(0.2) - 0.5)
    got = small_gaussian().log_ratio(np.array([12.0, 3.0, 99.0]), np.array([12.1, 3.5, 99.0]))
    np.testing.assert_allclose(got, [by_hand, 0.0, 0.0], atol=1e-12)


def test_log_ratio_is_the_difference_of_the_densities():
    before = np.linspace(0, 39, 50)
    now = before + np.linspace(-2, 2, 50)
    gaussian = small_gaussian()
    density = gaussian.log_density(before, now)
    np.testing.assert_allclose(gaussian.log_ratio(before, now), density[1] - density[0], rtol=1e-9, atol=1e-9)
    expected = norm.logpdf(now[15], before[15] + gaussian.mean_change[0, 2], gaussian.sigma[0, 2])
    assert density[0, 15] == pytest.approx(expected)


def test_density_integrates_to_one():
    gaussian = small_gaussian()
    for intention in (0, 1):
        area, _ = quad(
            lambda v, i=intention: np.exp(gaussian.log_density(np.array([12.0]), np.array([v])))[i, 0], 9, 15
        )
        assert area == pytest.approx(1.0, abs=1e-6)


def test_fit_is_mean_and_deviation_of_the_changes():
    rng = np.random.default_rng(0)
    change = rng.normal(0.2, 0.3, 100)
    label = np.arange(100) % 2
    fitted = SpeedGaussian.fit(np.full(100, 7.0), 7.0 + change, label)
    np.testing.assert_allclose(fitted.mean_change[:, 1], [change[::2].mean(), change[1::2].mean()], atol=1e-8)
    np.testing.assert_allclose(fitted.sigma[:, 1], [change[::2].std(), change[1::2].std()], atol=1e-8)


def test_a_bin_that_one_intention_hardly_saw_says_nothing():
    before = np.concatenate([np.full(40, 7.0), np.full(ENOUGH, 12.0), np.full(ENOUGH - 1, 12.0)])
    change = np.random.default_rng(1).normal(0.0, 0.1, len(before))
    label = np.concatenate([np.arange(40) % 2, np.zeros(ENOUGH), np.ones(ENOUGH - 1)]).astype(int)
    fitted = SpeedGaussian.fit(before, before + change, label)
    np.testing.assert_allclose(fitted.mean_change[:, 2], change[40:].mean(), atol=1e-8)  # both of that bin
    np.testing.assert_allclose(fitted.mean_change[:, 5], change.mean(), atol=1e-8)  # all: no car was that fast
    assert np.all(fitted.floored().log_ratio(np.array([12.0, 27.0]), np.array([12.3, 27.3])) == 0.0)
    assert np.all(fitted.floored().log_ratio(np.array([7.0]), np.array([7.3])) != 0.0)


def test_the_floor_keeps_a_deviation_from_vanishing():
    constant = SpeedGaussian.fit(np.full(40, 7.0), np.full(40, 7.1), np.arange(40) % 2)
    assert constant.sigma.max() == pytest.approx(0.0, abs=1e-8)
    assert constant.floored(0.05).sigma.min() == 0.05
    assert np.isfinite(constant.floored(0.05).log_ratio(np.array([7.0]), np.array([30.0]))).all()


@pytest.mark.parametrize("mean", [np.zeros((2, WIDE_BINS - 1)), np.full((2, WIDE_BINS), np.nan)])
def test_what_is_no_gaussian_is_refused(mean):
    with pytest.raises(ValueError, match=r"Gaussian|finite"):
        SpeedGaussian(mean, np.ones((2, WIDE_BINS)))

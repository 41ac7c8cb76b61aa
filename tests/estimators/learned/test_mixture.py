"""The Gaussian mixture of speed transitions, against scipy and by integration."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import dblquad, quad
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm
from small import small_mixture

from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.mixture import SpeedMixture

SPEED = st.floats(0, 30)


def joint(mixture, i, before, now):
    """Eq. 6, straight from scipy."""
    parts = [
        np.log(w) + multivariate_normal.logpdf([before, now], mean, covariance)
        for w, mean, covariance in zip(mixture.weights[i], mixture.means[i], mixture.covariances[i], strict=True)
    ]
    return logsumexp(parts)


def marginal(mixture, i, before):
    parts = zip(mixture.weights[i], mixture.means[i, :, 0], mixture.covariances[i, :, 0, 0], strict=True)
    return logsumexp([np.log(w) + norm.logpdf(before, mean, np.sqrt(variance)) for w, mean, variance in parts])


@given(before=SPEED, change=st.floats(-3, 3))
def test_densities_and_ratios_are_scipys(before, change):
    mixture, now = small_mixture(), before + change
    x, y = np.array([before]), np.array([now])
    expected = np.array([joint(mixture, i, before, now) for i in (0, 1)])
    rest = expected - [marginal(mixture, i, before) for i in (0, 1)]
    np.testing.assert_allclose(mixture.log_density(x, y, "joint")[:, 0], expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mixture.log_density(x, y)[:, 0], rest, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mixture.log_ratio(x, y, "joint")[0], expected[1] - expected[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mixture.log_ratio(x, y)[0], rest[1] - rest[0], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("intention", [0, 1])
@pytest.mark.parametrize("before", [5.0, 11.0, 18.0])
def test_the_conditional_density_integrates_to_one(before, intention):
    mixture = small_mixture()
    area, _ = quad(lambda v: np.exp(mixture.log_density(np.array([before]), np.array([v])))[intention, 0], -10, 40)
    assert area == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("intention", [0, 1])
def test_the_joint_density_integrates_to_one(intention):
    mixture = small_mixture()

    def density(now, before):
        return np.exp(mixture.log_density(np.array([before]), np.array([now]), "joint"))[intention, 0]

    mass, _ = dblquad(density, -5, 32, lambda x: x - 6, lambda x: x + 6, epsabs=1e-5)
    assert mass == pytest.approx(1.0, abs=1e-3)


def test_far_from_all_components_the_ratio_is_finite():
    ratio = small_mixture().log_ratio(np.array([0.0, 0.0, 300.0]), np.array([0.0, 30.0, 0.0]))
    assert np.isfinite(ratio).all()


def test_fit_finds_the_components_slowest_first():
    rng = np.random.default_rng(0)
    before = np.concatenate([rng.normal(15.0, 1.0, 600), rng.normal(6.0, 1.0, 400)])
    now = before + rng.normal(0.1, 0.2, 1000)
    fitted = SpeedMixture.fit(np.tile(before, 2), np.tile(now, 2), np.repeat([0, 1], 1000))
    np.testing.assert_allclose(fitted.weights[0], [0.4, 0.6], atol=0.01)
    own = [[speed[part].mean() for speed in (before, now)] for part in (slice(600, None), slice(600))]
    np.testing.assert_allclose(fitted.means[0], own, atol=0.01)
    slow = np.cov(before[600:], now[600:], bias=True)
    np.testing.assert_allclose(fitted.covariances[0, 0], slow, atol=0.02)
    np.testing.assert_array_equal(fitted.means[0], fitted.means[1])


def test_one_transition_is_too_few():
    with pytest.raises(UserError, match="1 different speed transitions of NOT_YIELD"):
        SpeedMixture.fit(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 3.0]), np.array([0, 0, 1]))


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"weights": np.array([[0.6, 0.6], [0.5, 0.5]])}, "sum to 1"),
        ({"weights": np.array([[0.6], [0.5]])}, "2 components"),
        ({"means": np.full((2, 2, 2), np.nan)}, "finite"),
        ({"covariances": np.ones((2, 2, 2, 2))}, "positive definite"),
    ],
)
def test_what_is_no_mixture_is_refused(bad, message):
    with pytest.raises(ValueError, match=message):
        replace(small_mixture(), **bad)

"""The interactive filter: what each type plans by hand, and what the filter believes of drivers of known types."""

import numpy as np
import pytest

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.compiled.drivers import ACCELERATE, IGNORE, LATE, NOT_YIELD, WAIT, YIELD, planned, reacting
from merge_cosim.estimators.compiled.type_filter import FilterLaw
from merge_cosim.estimators.driver_types import DRIVER_TYPES
from merge_cosim.estimators.interactive import Interactive

LAW = Interactive().law(Setting(29.0))


@pytest.mark.parametrize(
    ("kind", "arrival", "station", "speed", "expected"),
    [
        (YIELD, 3.0, -60.0, 20.0, 2 * (60 - 20 * 4) / 16),  # a second after the host
        (YIELD, 1.0, -60.0, 20.0, 0.0),  # late enough as it is
        (YIELD, 9.0, -20.0, 20.0, -4.0),  # the stop at the point is harder than the bound
        (YIELD, 9.0, -80.0, 20.0, -2.5),  # the stop at the point
        (NOT_YIELD, 3.0, -60.0, 20.0, 2 * (60 - 20 * 2) / 4 if 2 * (60 - 20 * 2) / 4 < 3 else 3.0),
        (NOT_YIELD, 5.0, -80.0, 19.0, 2 * (80 - 19 * 4) / 16),
        (NOT_YIELD, 9.0, -60.0, 20.0, 0.0),
        (IGNORE, 3.0, -60.0, 20.0, 0.0),
        (WAIT, 9.0, -60.0, 28.0, 0.4),  # a gap: free driving
        (WAIT, 3.0, -60.0, 20.0, -400 / 120),  # no gap: the stop at the point
        (WAIT, 9.0, -600.0, 20.0, 0.0),  # far from it
        (ACCELERATE, 3.0, -60.0, 20.0, 1.0),
        (LATE, 3.0, -60.0, 20.0, 0.0),  # not within 1 m of it
        (LATE, 3.0, -0.9, 20.0, 3.0),
    ],
)
def test_what_a_driver_plans(kind, arrival, station, speed, expected):
    assert planned(kind, 1.0, arrival, station, speed, LAW) == pytest.approx(expected)


def test_after_the_host_has_passed_drivers_follow_but_for_those_that_ignore_it():
    follows = 0.23 * (20 - 5 - 2 - 0.8 * 20) + 0.6 * (18 - 20)
    for kind in (YIELD, NOT_YIELD, WAIT):
        assert reacting(kind, 1.0, 5.0, 18.0, 5.0, -15.0, 20.0, LAW) == pytest.approx(follows)
    assert reacting(ACCELERATE, 1.0, 5.0, 18.0, 5.0, -15.0, 20.0, LAW) == 1.0
    assert reacting(ACCELERATE, 1.0, 20.0, 18.0, 5.0, 0.0, 20.0, LAW) == pytest.approx(follows)
    assert reacting(IGNORE, 1.0, 5.0, 18.0, 5.0, -15.0, 20.0, LAW) == 0.0


def test_whoever_is_faster_than_the_limit_slows_down():
    for kind in range(len(DRIVER_TYPES)):
        assert reacting(kind, 1.0, -200.0, 10.0, 5.0, -100.0, 34.0, LAW) <= -2.0


def believed(kind, cycles=40, reaction=5, noise=0.0, host_speed=18.0):
    """Beliefs after some cycles of a driver of a type with a margin of 1.4 s."""
    estimator = Interactive()
    estimator.start(1, Setting(29.0))
    rng = np.random.default_rng(0)
    host, station, speed = -90.0, -85.0, 17.0
    for k in range(cycles):
        seen = Observation(*(np.array([v]) for v in (host, host_speed, station, speed, 5.0, 5.0)))
        log_odds = estimator.update(seen)
        a = reacting(kind, 1.4, host, host_speed, 5.0, station, speed, LAW) if k >= reaction else 0.0
        speed = min(max(speed + (a + noise * rng.normal()) * 0.1, 0.0), 29.0)
        host, station = host + host_speed * 0.1, station + speed * 0.1
    return estimator.beliefs[0], log_odds[0]


@pytest.mark.parametrize("kind", [YIELD, NOT_YIELD])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_driver_is_recognised(kind, noise):
    belief, log_odds = believed(kind, noise=noise)
    assert belief.sum() == pytest.approx(1.0)
    assert belief[kind] > 0.8
    assert (log_odds > 2.0) == (kind == NOT_YIELD)


def test_a_driver_that_keeps_its_speed_is_believed_to_ignore():
    belief, _ = believed(IGNORE)
    assert belief.argmax() == IGNORE


def test_before_anything_is_seen_the_belief_is_the_prior():
    estimator = Interactive(start_yield=0.5, start_not_yield=0.2, start_ignore=0.2, start_accelerate=0, start_late=0)
    estimator.start(1, Setting(29.0))
    estimator.update(Observation(*(np.array([v]) for v in (-90.0, 18.0, -85.0, 17.0, 5.0, 5.0))))
    np.testing.assert_allclose(estimator.beliefs, [[0.5, 0.2, 0.2, 0.1, 0.0, 0.0]])
    assert len(DRIVER_TYPES) == estimator.beliefs.shape[1]
    assert estimator.unreacted[0] == pytest.approx(1.0)


def test_one_update_by_hand():
    """Two types only, no reaction time, no change: Bayes' rule on one acceleration."""
    estimator = Interactive(
        start_yield=0.5, start_not_yield=0.5, start_ignore=0.0, reaction_time=0.0, change_rate=0.0, outlier=0.0,
        min_margin=1.0, max_margin=1.0, start_accelerate=0.0, start_late=0.0, roughness_levels=1,
    )  # fmt: skip
    estimator.start(1, Setting(29.0))
    first = Observation(*(np.array([v]) for v in (-60.0, 20.0, -60.0, 20.0, 5.0, 5.0)))
    estimator.update(first)
    then = Observation(*(np.array([v]) for v in (-58.0, 20.0, -58.0, 19.9, 5.0, 5.0)))
    log_odds = estimator.update(then)[0]
    keep = np.exp(-0.1)
    variance = 0.3**2 + 0.3**2 * (1 - keep**2) + 0.1**2
    a_yield, a_not_yield = 2 * (60 - 20 * 4) / 16, 3.0
    expected = ((-1.0 - a_yield) ** 2 - (-1.0 - a_not_yield) ** 2) / (2 * variance)
    assert log_odds == pytest.approx(np.clip(expected, -np.log(1e6 - 1), np.log(1e6 - 1)))


def test_the_constants_of_the_filter_are_those_of_first_order_noise():
    """n_t = rho n_{t-1} + e, var(e) = sigma^2 (1 - rho^2) + white^2, rho = exp(-dt / correlation_time)."""
    found = Interactive(sigma=0.3, correlation_time=1.0, white=0.1, reaction_time=1.0, change_rate=0.05)
    found.start(1, Setting(29.0))
    rho = np.exp(-0.1)
    innovation = np.sqrt(0.09 * (1 - rho**2) + 0.01)
    assert found._filter_law == pytest.approx(FilterLaw(rho, 0.3, innovation, 2.4, 0.05, 1 - rho, 0.005))


def test_the_filter_is_that_of_numpy():
    """Levels of roughness, reaction, changes and outliers, once more with arrays over hypotheses."""
    n, rng = 8, np.random.default_rng(1)
    found = Interactive()
    found.start(n, Setting(29.0))
    f, kinds, traits = found._filter_law, found._kinds, found._traits
    weight = np.stack([np.tile(found._prior, (n, 1)), np.zeros((n, len(kinds)))], axis=1)
    level = np.full((n, found.roughness_levels), 1.0 / found.roughness_levels)
    off, evidence, last, expected = np.zeros_like(weight), np.zeros(n), None, None
    host, station, host_speed, speed = (rng.uniform(low, high, n) for low, high in (*2 * [(-90, -60)], *2 * [(10, 28)]))
    for age in range(60):
        odds = found.update(Observation(host, host_speed, station, speed, np.full(n, 5.0), np.full(n, 5.0)))
        if last is not None:
            weight = np.stack([weight[:, 0] * (1 - f.reacts), weight[:, 1] + weight[:, 0] * f.reacts], axis=1)
            weight += f.changes * (found._prior * weight.sum(axis=2, keepdims=True) - weight)
            level = 0.99 * level / level.sum(axis=1, keepdims=True) + 0.01 / level.shape[1]
            means = np.stack([np.zeros_like(expected), expected], axis=1)
            now = ((speed - last) / 0.1)[:, None, None] - means
            e = now if age == 1 else now - f.keep * off
            s = (np.hypot(f.sigma, f.innovation) if age == 1 else f.innovation) * f.rougher ** np.arange(4)
            density = np.exp(-0.5 * (e[..., None] / s) ** 2) / (s * np.sqrt(2 * np.pi))
            density = (1 - f.outlier) * density + f.outlier * 0.1
            by_level = (weight[..., None] * density).sum(axis=(1, 2))
            weight = weight * (density * level[:, None, None, :]).sum(axis=-1)
            total, off = weight.sum(axis=(1, 2)), now
            level = level * by_level / total[:, None]
            evidence += np.where(np.maximum(host, station) < 0, np.log(total), 0.0)
            weight /= total[:, None, None]
        beliefs = np.stack([weight[:, :, kinds == kind].sum(axis=(1, 2)) for kind in range(len(DRIVER_TYPES))], axis=1)
        np.testing.assert_allclose(found.beliefs, beliefs, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found.evidence, evidence, rtol=1e-9, atol=1e-9)
        assert np.isfinite(odds).all()
        states = zip(host, host_speed, station, speed, strict=True)
        expected = [
            [reacting(k, t, h, v, 5.0, s, u, LAW) for k, t in zip(kinds, traits, strict=True)] for h, v, s, u in states
        ]
        expected = np.minimum(expected, np.maximum((29.0 - speed) / 0.1, 0.0)[:, None])
        expected = np.maximum(expected, np.minimum(-speed / 0.1, 0.0)[:, None])
        last = speed.copy()
        speed = np.clip(speed + rng.normal(0, 0.05 * (1 + np.arange(n)), n), 0, 29)
        host, station = host + host_speed * 0.1, station + speed * 0.1
    assert level.argmax(axis=1).min() < level.argmax(axis=1).max()  # drivers of different roughness

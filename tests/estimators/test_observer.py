"""The observer of `interactive`: exact reports stay, noise is measured, the Kalman filter is the textbook's."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from merge_cosim.estimators.compiled.observer import (
    COVARIANCE,
    MEMORY,
    RUNS,
    ObserverLaw,
    correct,
    noise,
    observe,
    predict,
)

DT = 0.1

DEFAULTS = {"exact": 0.01, "change": 0.2, "latency": 0.0, "compensated": False, "unknown": 0.2, "dt": DT}


def observed(station, speed, **law):
    """Stations, speeds, accelerations, deviations and memory of one car over all cycles."""
    memory, age = np.zeros((1, MEMORY)), np.ones(1, np.int64)
    state = np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((3, 1)), np.zeros(1)
    rows, deviations = [], []
    fixed = ObserverLaw(**DEFAULTS | law)
    for x, v in zip(station, speed, strict=True):
        observe(np.array([x]), np.array([v]), fixed, memory, *state, age)
        rows.append([one[0] for one in state[:3]])
        deviations.append(state[3][:, 0].copy())
    return np.array(rows).T, np.array(deviations).T, memory[0], age[0]


def track(cycles, rng, first=-400.0):
    """A car whose acceleration changes at random, by SUMO's rule of motion."""
    speed = np.maximum(15.0 + np.cumsum(DT * np.cumsum(rng.normal(0.0, 0.1, cycles))), 0.0)
    return first + np.cumsum(DT * speed), speed


def test_exact_reports_stay_as_they_are_to_the_last_bit():
    station, speed = track(200, np.random.default_rng(1))
    station = np.round(station, 6)  # as SUMO's world rounds it
    (x, v, a), deviation, _, age = observed(station, speed)
    assert np.array_equal(x, station)
    assert np.array_equal(v, speed)
    assert not deviation.any()
    assert age == 1
    assert np.isnan(a[0])
    assert np.array_equal(a[1:], (speed[1:] - speed[:-1]) / DT)


def test_a_speed_that_was_smoothed_is_no_noise():
    station, speed = track(200, np.random.default_rng(2))
    smoothed = np.convolve(speed, np.full(5, 0.2))[:200]
    smoothed[:4] = speed[:4]
    (x, v, _), deviation, _, _ = observed(station[4:], smoothed[4:])
    assert np.array_equal(x, station[4:])
    assert np.array_equal(v, smoothed[4:])
    assert not deviation.any()


@pytest.mark.parametrize(("station_sigma", "speed_sigma"), [(1.0, 0.5), (0.5, 0.1), (1.0, 0.0)])
def test_the_noise_of_station_and_speed_is_measured(station_sigma, speed_sigma):
    rng = np.random.default_rng(3)
    station, speed = track(4000, rng, first=-1e6)
    reports = station + rng.normal(0, station_sigma, 4000), speed + rng.normal(0, speed_sigma, 4000)
    (x, v, _), deviation, memory, age = observed(*reports)
    assert np.sqrt(noise(memory, DT)) == pytest.approx([station_sigma, max(speed_sigma, 0.01)], rel=0.06, abs=0.02)
    assert memory[RUNS] == 1.0
    assert age == 0
    for seen, true, reported, spread in ((x, station, reports[0], deviation[0]), (v, speed, reports[1], deviation[1])):
        error = np.std((seen - true)[100:])
        assert error < max(0.8 * np.std((reported - true)[100:]), 0.02)
        assert error == pytest.approx(np.sqrt(np.mean(spread[100:] ** 2)), rel=0.35, abs=0.02)


def test_the_covariance_tends_to_the_solution_of_riccatis_equation():
    change, variances = 0.2, (1.0, 0.25)
    memory = np.zeros(MEMORY)
    memory[[COVARIANCE, COVARIANCE + 3, COVARIANCE + 5]] = 1.0
    for _ in range(2000):
        for part, variance in enumerate(variances):
            correct(memory, part, 0.0, variance)
        predict(memory, change, DT)
    forward = np.array([[1, DT, DT**2], [0, 1, DT], [0, 0, 1]])
    push = np.array([DT**2, DT, 1.0])
    seen = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    due = solve_discrete_are(forward.T, seen.T, change**2 * np.outer(push, push), np.diag(variances))
    assert memory[COVARIANCE:] == pytest.approx(due[np.triu_indices(3)], rel=1e-6)


def test_a_known_latency_moves_the_state_on():
    station, speed = -100.0 + 2.0 * np.arange(30), np.full(30, 20.0)
    (x, v, _), _, _, _ = observed(station, speed, latency=0.3)
    assert x == pytest.approx(station + 6.0)
    assert v == pytest.approx(speed)
    speed = 20.0 - 0.2 * np.arange(30)
    station = -100.0 + np.cumsum(DT * speed)
    (x, v, _), _, _, _ = observed(station, speed, latency=0.3)
    assert v[-1] == pytest.approx(speed[-1] - 0.6)
    assert x[-1] == pytest.approx(station[-1] + 0.3 * (speed[-1] - 0.3))
    (moved, same, _), _, _, _ = observed(station + 0.3 * speed, speed, latency=0.3, compensated=True)
    assert moved == pytest.approx(x)
    assert same == pytest.approx(v)

"""A model small enough to compute with by hand, and what one car looks like in one cycle."""

import numpy as np

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.learned.gaussian import WIDE_BINS, SpeedGaussian
from merge_cosim.estimators.learned.histogram import SPEED_BINS, TIME_BINS, ArrivalHistogram, SpeedHistogram
from merge_cosim.estimators.learned.mixture import SpeedMixture
from merge_cosim.estimators.learned.model import IntentionModel, SpeedModel


def small_histogram() -> SpeedHistogram:
    counts = np.zeros((2, SPEED_BINS, SPEED_BINS), dtype=np.int64)
    counts[0, 10, [9, 10]] = [3, 1]
    counts[1, 10, [10, 11]] = [1, 3]
    counts[0, 20, 20] = 5  # seen under YIELD only
    return SpeedHistogram(counts)


def small_gaussian() -> SpeedGaussian:
    """At 10 to 15 m/s: N(-0.1, 0.2) under YIELD, N(0.3, 0.1) under NOT_YIELD; the same for both elsewhere."""
    mean, sigma = np.zeros((2, WIDE_BINS)), np.full((2, WIDE_BINS), 0.1)
    mean[:, 2], sigma[:, 2] = [-0.1, 0.3], [0.2, 0.1]
    return SpeedGaussian(mean, sigma)


def small_mixture() -> SpeedMixture:
    return SpeedMixture(
        weights=np.array([[0.6, 0.4], [0.5, 0.5]]),
        means=np.array([[[8.0, 7.9], [15.0, 15.0]], [[9.0, 9.2], [16.0, 16.1]]]),
        covariances=np.array(
            [[[[4.0, 3.9], [3.9, 4.0]], [[2.0, 1.8], [1.8, 2.1]]], [[[3.0, 2.9], [2.9, 3.1]], [[5.0, 4.8], [4.8, 5.0]]]]
        ),
    )


def small_model() -> IntentionModel:
    shares = np.zeros((2, TIME_BINS, TIME_BINS))
    shares[0, 10, 4] = 2.0
    shares[1, 4, 10] = 1.0
    return IntentionModel(
        name="small",
        site="us101",
        source="ngsim",
        trained_on=("us101/a/1/1",),
        settings={},
        pairs=np.array([2, 1]),
        merge_speed=12.5,
        speeds={1: SpeedModel(small_histogram(), small_gaussian(), small_mixture())},
        arrivals=ArrivalHistogram(shares),
    )


def seen(speed, merging=-50.0, host=-50.0, host_speed=10.0):
    speed = np.atleast_1d(np.asarray(speed, dtype=float))
    n = len(speed)
    return Observation(
        np.full(n, host), np.full(n, host_speed), np.full(n, merging), speed, np.full(n, 5.0), np.full(n, 5.0)
    )


def begin(estimator, model):
    """Give an estimator a model and one driver."""
    estimator.use(model)
    estimator.start(1, Setting())
    estimator.reset(np.array([0]), np.array([0]), np.zeros(1, dtype=np.uint64))
    return estimator

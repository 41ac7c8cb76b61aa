"""What every registered estimator and controller must keep, whoever wrote it."""

import numpy as np
import pytest

from merge_cosim.controllers.base import controllers
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.core.registry import parameters
from merge_cosim.estimators.base import estimators
from merge_cosim.estimators.learned.model import IntentionModel

CYCLES, COUNT = 70, 12


def scenes(seed=0):
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0, 25, (2, COUNT))
    station = rng.uniform(-120, -30, (2, COUNT))
    for _ in range(CYCLES):
        speed = np.clip(speed + rng.normal(0, 0.3, speed.shape), 0, 30)
        station = station + 0.1 * speed
        yield Observation(station[0], speed[0], station[1], speed[1], np.full(COUNT, 5.0), np.full(COUNT, 4.5))


def pick(scene, rows):
    return Observation(*(getattr(scene, name)[rows] for name in Observation.__dataclass_fields__))


def make(name):
    estimator = estimators[name]()
    if estimator.needs_model:
        estimator.use(IntentionModel.load("us101-ngsim"))
    return estimator


def watch(estimator, rows, labels):
    estimator.start(len(rows), Setting())
    estimator.reset(np.arange(len(rows)), labels[rows], KEYS[rows])
    return np.array([estimator.update(pick(scene, rows)) for scene in scenes()])


LABELS = np.arange(COUNT) % 2
KEYS = stream_keys(LABELS.astype(str), 3) + np.arange(COUNT, dtype=np.uint64)


@pytest.mark.parametrize("name", estimators.names())
def test_estimators_do_not_depend_on_their_batch(name):
    whole = watch(make(name), np.arange(COUNT), LABELS)
    assert whole.shape == (CYCLES, COUNT)
    assert not np.isnan(whole).any()
    order = np.random.default_rng(1).permutation(COUNT)
    np.testing.assert_array_equal(watch(make(name), order, LABELS), whole[:, order])
    np.testing.assert_array_equal(watch(make(name), np.array([4]), LABELS), whole[:, [4]])


@pytest.mark.parametrize("name", estimators.names())
def test_estimators_forget_on_reset(name):
    estimator = make(name)
    first = watch(estimator, np.arange(COUNT), LABELS)
    estimator.reset(np.arange(COUNT), LABELS, KEYS)
    again = np.array([estimator.update(scene) for scene in scenes()])
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("name", controllers.names())
def test_controllers_do_not_depend_on_their_batch(name):
    target = np.arange(COUNT) % 3 == 0
    log_odds = np.linspace(-3, 3, COUNT)

    def drive(rows):
        controller = controllers[name]()
        controller.start(len(rows), Setting())
        controller.reset(np.arange(len(rows)))
        return np.array([controller.command(pick(s, rows), log_odds[rows], target[rows]) for s in scenes()])

    whole = drive(np.arange(COUNT))
    assert np.isfinite(whole).all()
    assert (whole >= -4.0).all()
    assert (whole <= 2.0).all()
    order = np.random.default_rng(2).permutation(COUNT)
    np.testing.assert_array_equal(drive(order), whole[:, order])
    np.testing.assert_array_equal(drive(np.array([7])), whole[:, [7]])


@pytest.mark.parametrize("name", controllers.names())
def test_what_a_controller_takes_from_an_estimator_are_parameters_of_both(name):
    for estimator in estimators.names():
        taken = controllers[name]().taken_from(estimators[estimator]())
        assert taken.keys() <= parameters(controllers[name]).keys()
        assert taken.items() <= parameters(estimators[estimator]).items()

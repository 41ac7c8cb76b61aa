"""What every registered sensor must keep, and every estimator and controller under each of them."""

import numpy as np
import pytest
from cases import random_encounters

from merge_cosim.controllers.base import controllers
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.estimators.base import estimators
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.merging_cars.designed import Designed
from merge_cosim.scoring.rules import Rules
from merge_cosim.sensors.base import sensors
from merge_cosim.sensors.noisy import Noisy
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld

COUNT = 12
KEYS = stream_keys(np.array([f"c{i}" for i in range(COUNT)]), 0)
BAD = Noisy(
    delay=0.4, station_bias=-3.0, speed_bias=2.0, station_sigma=8.0, speed_sigma=5.0, time_constant=0.2,
    station_step=3.0, speed_step=2.0, dropout=0.4, dropout_time=0.5, lost="hold",
)  # fmt: skip
EVERY = {**{name: sensors[name] for name in sensors.names()}, "bad": lambda: BAD}


def observed(sensor, rows):
    rng = np.random.default_rng(0)
    station, speed = rng.uniform(-90, -40, (2, COUNT)), rng.uniform(0, 25, (2, COUNT))
    sensor.start(len(rows), Setting())
    sensor.reset(np.arange(len(rows)), KEYS[rows])
    found = []
    for _ in range(60):
        station = station + 0.1 * speed
        states = (station[0], speed[0], station[1], speed[1], np.full(COUNT, 5.0), np.full(COUNT, 4.5))
        seen = sensor.observe(Observation(*(state[rows] for state in states)))
        found.append([getattr(seen, name) for name in Observation.__dataclass_fields__])
    return np.array(found)


@pytest.mark.parametrize("name", EVERY)
def test_sensors_do_not_depend_on_their_batch(name):
    whole = observed(EVERY[name](), np.arange(COUNT))
    assert np.isfinite(whole).all()
    order = np.random.default_rng(1).permutation(COUNT)
    np.testing.assert_array_equal(observed(EVERY[name](), order), whole[:, :, order])
    np.testing.assert_array_equal(observed(EVERY[name](), np.array([4])), whole[:, :, [4]])


def run(estimator, sensor, encounters, slots):
    made = estimators[estimator]()
    if made.needs_model:
        made.use(IntentionModel.load("us101-ngsim"))
    driver = HostDriver(made, controllers[made.default_controller](), sensor)
    return Loop(ClosedFormWorld(slots), encounters, driver, Designed(), Rules(), Setting()).run().columns


@pytest.mark.parametrize("estimator", estimators.names())
def test_every_method_drives_under_every_sensor(estimator):
    """The loop refuses NaN in beliefs and commands; no operation is invalid either."""
    encounters = random_encounters(COUNT, seed=1)
    for make in EVERY.values():
        with np.errstate(invalid="raise"):
            columns = run(estimator, make(), encounters, COUNT)
        assert np.isfinite(columns["end_station"]).all()


def test_a_case_does_not_depend_on_the_slots():
    encounters = random_encounters(COUNT, seed=2)
    whole = run("pgm", BAD, encounters, COUNT)
    for name, column in run("pgm", BAD, encounters, 5).items():
        np.testing.assert_array_equal(column, whole[name], err_msg=name)

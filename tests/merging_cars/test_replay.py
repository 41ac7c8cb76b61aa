"""A replayed merging car meets its log, is observed as the log says, and goes on at its last speed."""

from dataclasses import replace

import numpy as np

from merge_cosim.core.encounter import NEVER, Encounters, Ragged, ReplayLog
from merge_cosim.core.observation import Setting
from merge_cosim.merging_cars.replay import Replay

STATIONS = (np.array([-3.0, -2.0, -0.5, 1.5]), np.array([-9.0, -8.0]))
SEEN = (np.array([9.0, 11.0, 16.0, 19.0]), np.array([8.0, 12.0]))


def ready() -> Replay:
    """Both logs in a batch of two, the second one in the first row."""
    start = {"host_station": 0.0, "host_speed": 0.0, "merging_station": -3.0, "merging_speed": 10.0}
    made = Encounters.unlogged(np.array(["a", "b"]), "us101", "ngsim", **start, host_length=5.0, merging_length=5.0)
    track, seen = Ragged.of(STATIONS), Ragged.of(SEEN)
    log = ReplayLog(track, seen, track, np.array([2, 1]), np.full(2, NEVER))
    car = Replay()
    car.start(replace(made, log=log), 2, Setting())
    car.reset(np.array([0, 1]), np.array([1, 0]))
    return car


def test_speeds_are_the_ways_to_the_next_logged_station() -> None:
    car, station = ready(), np.array([STATIONS[1][0], STATIONS[0][0]])
    for age, expected in enumerate(([-8.0, -2.0], [-7.0, -0.5], [-6.0, 1.5], [-5.0, 3.5])):  # from a log's end on ahead
        station = station + 0.1 * car.speed(np.full(2, age))
        np.testing.assert_allclose(station, expected)


def test_what_is_observed_is_logged_to_the_end_and_then_true() -> None:
    car, true = ready(), np.array([1.0, 2.0])
    for age, expected in enumerate(([8.0, 9.0], [12.0, 11.0], [1.0, 16.0], [1.0, 19.0], [1.0, 2.0])):
        np.testing.assert_array_equal(car.observed_speed(np.full(2, age), true), expected)

"""The noisy sensor: each error by hand or by its distribution, and what stays the same without errors."""

import numpy as np
import pytest

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.sensors.base import sensors
from merge_cosim.sensors.noisy import Noisy
from merge_cosim.sensors.perfect import Perfect
from merge_cosim.sensors.presets import Camera, Coarse, Late, Radar


def scene(station, speed):
    station, speed = np.atleast_1d(station).astype(float), np.atleast_1d(speed).astype(float)
    n = len(station)
    return Observation(np.full(n, -50.0), np.full(n, 15.0), station, speed, np.full(n, 5.0), np.full(n, 4.0))


def begun(sensor, count=1, seed=0):
    sensor.start(count, Setting())
    sensor.reset(np.arange(count), stream_keys(np.array([f"c{i}" for i in range(count)]), seed))
    return sensor


def watched(sensor, cycles, count=1, speed=10.0, seed=0):
    """Stations and speeds as observed of cars at a constant speed, minus the true ones; shape (2, cycles, count)."""
    begun(sensor, count, seed)
    found = []
    for cycle in range(cycles):
        true = scene(np.full(count, -90.0 + 0.1 * speed * cycle), np.full(count, speed))
        seen = sensor.observe(true)
        found.append([seen.merging_station - true.merging_station, seen.merging_speed - true.merging_speed])
    return np.array(found).transpose(1, 0, 2)


def test_without_errors_the_truth_is_seen():
    true = scene([-40.0, -30.0], [10.0, 0.0])
    seen = begun(Noisy(), 2).observe(true)
    assert all(np.array_equal(getattr(seen, name), getattr(true, name)) for name in Observation.__dataclass_fields__)
    assert Perfect().observe(true) is true


def test_a_delayed_state_is_as_old_as_it_should_be():
    sensor = begun(Noisy(delay=0.2))
    stations, speeds = [-50.0, -49.0, -47.8, -46.4, -44.8], [10.0, 10.0, 12.0, 14.0, 16.0]
    seen = [sensor.observe(scene(*state)) for state in zip(stations, speeds, strict=True)]
    # before the start the car drove at its initial speed
    assert [s.merging_station[0] for s in seen] == pytest.approx([-52.0, -51.0, -50.0, -49.0, -47.8])
    assert [s.merging_speed[0] for s in seen] == [10.0, 10.0, 10.0, 10.0, 12.0]
    assert {s.host_station[0] for s in seen} == {-50.0}  # the host knows its own state


def test_time_stamps_tell_methods_the_delay_in_whole_cycles():
    assert begun(Noisy(delay=0.32)).declared(Setting()).latency == pytest.approx(0.3)
    assert begun(Noisy(delay=0.3, stamped=False)).declared(Setting()).latency is None
    assert begun(Coarse(compensated=True)).declared(Setting(20.0)) == Setting(
        20.0, latency=pytest.approx(0.3), compensated=True
    )
    assert Perfect().declared(Setting()) == Setting()


def test_a_known_delay_is_made_up_for_at_the_observed_speed():
    sensor = begun(Noisy(delay=0.2, compensated=True))
    states = [(-50.0, 10.0), (-49.0, 10.0), (-47.8, 12.0), (-46.4, 14.0), (-44.8, 16.0)]
    seen = [sensor.observe(scene(*state)).merging_station[0] for state in states]
    assert seen == pytest.approx([-50.0, -49.0, -48.0, -47.0, -45.4])  # -47.8 + 0.2 * 12 at last


def test_a_slot_that_begins_again_sees_nothing_of_the_last_encounter():
    sensor = begun(Noisy(delay=0.3), 2)
    for cycle in range(5):
        sensor.observe(scene([-90.0 + cycle, -90.0 + cycle], [10.0, 10.0]))
    sensor.reset(np.array([1]), np.array([7], dtype=np.uint64))
    seen = sensor.observe(scene([-85.0, -60.0], [10.0, 20.0]))
    assert seen.merging_station == pytest.approx([-88.0, -66.0])
    assert seen.merging_speed == pytest.approx([10.0, 20.0])


def test_bias_and_steps():
    sensor = begun(Noisy(station_bias=1.3, speed_bias=-0.4, station_step=0.5, speed_step=0.25), 2)
    seen = sensor.observe(scene([-40.0, -39.9], [10.0, 0.1]))
    assert seen.merging_station.tolist() == [-38.5, -38.5]  # -38.7 and -38.6
    assert seen.merging_speed.tolist() == [9.5, 0.0]  # 9.6, and -0.3, which is no speed


def test_white_noise_has_its_deviations_and_no_memory():
    station, speed = watched(Noisy(station_sigma=2.0, speed_sigma=0.5), 300, 60)
    assert station.std() == pytest.approx(2.0, rel=0.02)
    assert speed.std() == pytest.approx(0.5, rel=0.02)
    for one, other in ((station[:-1], station[1:]), (speed[:-1], speed[1:]), (station, speed)):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.03


def test_first_order_noise_has_its_deviation_from_the_start_and_its_time_constant():
    station, _ = watched(Noisy(station_sigma=2.0, time_constant=0.5), 200, 600)
    assert station[0].std() == pytest.approx(2.0, rel=0.1)
    assert station.std() == pytest.approx(2.0, rel=0.03)
    assert np.corrcoef(station[:-5].ravel(), station[5:].ravel())[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


@pytest.mark.parametrize(("time", "length"), [(0.0, 1.0 / 0.8), (0.6, 6.0)])
def test_dropouts_have_their_share_and_length(time, length):
    station, speed = watched(Noisy(dropout=0.2, dropout_time=time, lost="hold"), 1000, 60)
    lost = station < -1e-9  # a held station falls behind a moving car
    assert (speed == 0.0).all()
    assert lost[200:].mean() == pytest.approx(0.2, abs=0.015)
    assert not lost[0].any()
    begins = (lost[1:] & ~lost[:-1]).sum()
    assert lost[1:].sum() / begins == pytest.approx(length, rel=0.05)


def test_a_dropout_is_bridged_at_the_last_speed():
    station, _ = watched(Noisy(dropout=0.5), 50, 20)
    assert np.abs(station).max() < 1e-9
    sensor = begun(Noisy(dropout=0.99, dropout_time=100.0))  # lost after the first cycle, nearly for ever
    sensor._is_lost[:] = False
    sensor.observe(scene(-50.0, 10.0))
    sensor._is_lost[:] = True
    for cycle in range(1, 4):
        seen = sensor.observe(scene(-20.0, 25.0))
        assert (seen.merging_station[0], seen.merging_speed[0]) == pytest.approx((-50.0 + cycle, 10.0))


def test_seeds_and_cases_have_noise_of_their_own():
    first, _ = watched(Noisy(station_sigma=1.0), 20, 3)
    again, _ = watched(Noisy(station_sigma=1.0), 20, 3)
    np.testing.assert_array_equal(first, again)
    assert len(set(first[0])) == 3
    for other in (
        watched(Noisy(station_sigma=1.0, seed=1), 20, 3)[0],
        watched(Noisy(station_sigma=1.0), 20, 3, seed=1)[0],
    ):
        assert (other != first).all()


def test_presets_are_noisy_sensors_with_other_values():
    for cls in (Radar, Camera, Late, Coarse):
        assert sensors[cls.name] is cls
        np.testing.assert_array_equal(
            watched(cls(), 30, 4), watched(Noisy(**{key: getattr(cls(), key) for key in vars(cls())}), 30, 4)
        )

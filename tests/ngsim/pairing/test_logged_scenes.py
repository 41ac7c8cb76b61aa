"""Scenes: all logged cars of a recording, on the clock and with the positions of the pairs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from trajectory_tables import steady, table

from merge_cosim.ngsim.pairing.encounters import site_encounters
from merge_cosim.ngsim.pairing.pairs import extract_pairs
from merge_cosim.ngsim.pairing.recordings import episode_scenes, pair_in_scene, scenes_of, site_scenes
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.tracks import build_tracks
from merge_cosim.ngsim.sites import site

US101 = site("us101")

CARS = table(
    steady(1, [2] * 40, at=-50, frame=100),
    steady(2, [5] * 60, at=-20, frame=95, length=float("nan")),
    steady(2, [5] * 20, at=-20, frame=170, part=2),
    steady(3, [7] * 10 + [6] * 30 + [5] * 20, at=-15, frame=95),
    steady(4, [6] * 30 + [8] * 20, at=180, speed=12, frame=110),
    steady(1, [3] * 10, at=0, frame=7, recording="another"),
)


def test_every_car_of_a_recording_is_in_its_scene() -> None:
    scenes = scenes_of(build_tracks(CARS, US101, PairRules(), everywhere=True), US101, PairRules())
    assert list(scenes) == ["another", "r"]
    assert (scenes["another"].cycles, scenes["another"].car.tolist()) == (10, ["1.1"])
    scene = scenes["r"]
    assert scene.car.tolist() == ["1.1", "2.1", "2.2", "3.1", "4.1"]
    assert scene.vehicle.tolist() == [1, 2, 2, 3, 4]
    assert scene.enters.tolist() == [5, 0, 75, 0, 15]
    assert scene.last.tolist() == [44, 59, 94, 59, 64]
    assert scene.cycles == 95
    np.testing.assert_allclose(scene.length, [4, 5, 4, 4, 4])
    assert scene.length_missing.tolist() == [False, True, False, False, False]
    assert scene.present(50).tolist() == [1, 3, 4]
    np.testing.assert_allclose(scene.x[scene.row(np.array([1, 3]), 50)], np.array([-20, -15]) + 1.5 * 145)
    # on-ramp, auxiliary lane and off-ramp are one path
    assert scene.lane[scene.row(np.array([3]), 0)] == 6
    assert scene.lane[scene.row(np.array([4]), 64)] == 6
    with pytest.raises(KeyError, match=r"no car '9\.1'"):
        scene.index("9.1")
    with pytest.raises(ValueError, match="backwards"):
        replace(scene, x=-scene.x)


def test_a_pair_is_found_in_its_scene() -> None:
    scenes = scenes_of(build_tracks(CARS, US101, PairRules(), everywhere=True), US101, PairRules())
    late = PairRules(max_window=2.5)
    for rules in (PairRules(), late):
        encounters = extract_pairs(CARS, US101, rules, "ngsim").encounters
        scene, pair = pair_in_scene(scenes, encounters, 0)
        assert (scene.recording, pair.host, pair.merging) == ("r", "2.1", "3.1")
        assert pair.start == (15 if rules is late else 0)


def test_real_encounters_have_their_very_stations_in_the_scenes(data_dir: Path) -> None:
    encounters = site_encounters(data_dir, US101)
    assert encounters is not None
    assert encounters.log is not None
    scenes = {**site_scenes(data_dir, US101), **episode_scenes(data_dir, US101)}
    for row in range(len(encounters)):
        scene, pair = pair_in_scene(scenes, encounters, row)
        logs = {pair.merging: encounters.log.merging_station[row], pair.host: encounters.log.host_station[row]}
        for name, station in logs.items():
            car = scene.index(name)
            first = scene.row(np.array(car), pair.start)
            assert first + len(station) <= scene.offsets[car + 1]
            x = scene.x[first : first + len(station)]
            np.testing.assert_allclose(x, station + encounters.merge_position[row], atol=1e-9, rtol=0)
        merging = np.array(scene.index(pair.merging))
        change = pair.start + int(encounters.log.change_cycle[row])
        assert scene.lane[scene.row(merging, change)] == US101.host_lane
        assert scene.lane[scene.row(merging, change - 1)] == US101.ramp_lanes[0]

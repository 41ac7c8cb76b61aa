"""Logged cars in a real SUMO: where their logs have them, and what becomes of those that leave their logs."""

from collections.abc import Iterator
from pathlib import Path

import libsumo
import numpy as np
import pyarrow as pa
import pytest
from trajectory_tables import Car, steady, table

from merge_cosim.ngsim.pairing.recordings import LoggedScene, scenes_of, site_scenes
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.tracks import build_tracks
from merge_cosim.ngsim.sites import site
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.worlds.logged_traffic import LoggedTraffic, logged_road
from merge_cosim.sumo.options import LOGGED, SumoOptions
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.start import LibsumoSession
from merge_cosim.sumo.vehicle_types import ReleasedDrivers

US101 = site("us101")

RAMP = Ramp.load("us101")
ROAD = logged_road(RAMP)


def scene_of(*cars: Car) -> LoggedScene:
    cars_table: pa.Table = table(*cars)
    return scenes_of(build_tracks(cars_table, US101, PairRules(), everywhere=True), US101, PairRules())["r"]


@pytest.fixture(params=["EIDM", "Krauss"])
def sumo(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[None]:
    """A running SUMO with the net and the type of the logged cars, by two car-following models."""
    types = tmp_path / "types.add.xml"
    ReleasedDrivers(car_following=request.param).write(types)
    session = LibsumoSession(SumoOptions(RAMP.net, extra=("--additional-files", str(types)), profile=LOGGED))
    yield
    session.close()


def shown() -> dict[str, tuple[int, float]]:
    """Lane and x of each car in SUMO."""
    places = {}
    for name in libsumo.vehicle.getIDList():
        strip = ROAD.at(libsumo.vehicle.getLaneID(name))
        assert strip is not None
        places[name] = (strip.lane, strip.start + libsumo.vehicle.getLanePosition(name))
    return places


def differences(scene: LoggedScene, first: int = 0) -> float:
    """Replay a scene from a cycle on, compare every cycle, and return the worst difference of positions [m]."""
    traffic = LoggedTraffic(Session(libsumo), scene, RAMP)
    worst = 0.0
    for cycle in range(first, scene.cycles + 1):  # one more, in which all are gone
        traffic.advance(cycle)
        libsumo.simulationStep()
        places, cars = shown(), scene.present(cycle)
        assert set(places) == set(scene.car[cars]) == set(traffic.driven)
        for car, row in zip(cars, scene.row(cars, cycle), strict=True):
            lane, x = places[scene.car[car]]
            assert lane == scene.lane[row], (scene.car[car], cycle)
            worst = max(worst, abs(x - scene.x[row]))
    return worst


def wavy(vehicle: int, lanes: list[int], at: float) -> Car:
    """A car that brakes to a stop, is logged to run backwards there, and goes on."""
    speed = np.concatenate([np.linspace(12, 0, 40), np.full(15, -0.02), np.linspace(0, 14, len(lanes) - 55)])
    return Car(vehicle, lanes, at + np.cumsum(speed) * 0.1)


CARS = (
    steady(1, [1] * 60 + [2] * 60 + [3] * 80, at=-150),  # through, with changes to the right
    steady(2, [5] * 30 + [4] * 90, at=-30, frame=12),  # comes later, changes to the left, ends mid-way
    steady(3, [7] * 20 + [6] * 40 + [5] * 60, at=-30, speed=16),  # merges
    steady(4, [5] * 70 + [6] * 60 + [8] * 20, at=-10, speed=16),  # leaves by the off-ramp
    steady(5, [4] * 40 + [3] * 60, at=-59.8, speed=15),  # changes lane as it passes the gore
    steady(6, [2] * 41 + [1] * 60, at=-61, speed=15),  # likewise, into the left-most lane
    steady(7, [5] * 40 + [3] * 60, at=30, speed=15),  # two lanes at once
    steady(8, [7] * 10 + [5] * 60, at=-30, speed=15),  # over the gore's nose
    steady(9, [5] * 20 + [8] * 40, at=203, speed=5),  # into the off-ramp over its nose
    steady(9, [4] * 20, at=203, speed=5, frame=70, part=2),  # comes back after a gap
    steady(10, [3] * 5, at=100),
    steady(11, [3], at=100, frame=9),
    steady(12, [5] * 60 + [6] * 10 + [5] * 60, at=-60, speed=14),  # through the auxiliary lane and back
    wavy(13, [2] * 60 + [3] * 40, at=-20),
    steady(14, [2] * 200, at=-145),  # drives through car 1 after its change
)


@pytest.mark.usefixtures("sumo")
@pytest.mark.parametrize("first", [0, 33])
def test_every_car_is_where_its_log_has_it_in_every_cycle(first: int) -> None:
    assert differences(scene_of(*CARS), first) < 1e-9


@pytest.mark.usefixtures("sumo")
def test_a_real_recording_is_replayed(data_dir: Path) -> None:
    assert differences(site_scenes(data_dir, US101)["us101_A"]) < 1e-9


@pytest.mark.usefixtures("sumo")
def test_routes_come_from_the_logs() -> None:
    traffic = LoggedTraffic(Session(libsumo), scene_of(*CARS), RAMP)
    for cycle in range(20):
        traffic.advance(cycle)
        libsumo.simulationStep()
    route = libsumo.vehicle.getRoute
    assert route("1.1") == ("main_in", "weave", "main_out")
    assert route("3.1") == ("ramp", "weave", "main_out")
    assert route("4.1") == ("main_in", "weave", "exit")
    assert route("12.1") == ("main_in", "weave", "main_out")


@pytest.mark.usefixtures("sumo")
def test_cycles_follow_each_other() -> None:
    traffic = LoggedTraffic(Session(libsumo), scene_of(steady(1, [1] * 9, at=0, frame=5), steady(2, [1], at=0)), RAMP)
    traffic.advance(3)
    with pytest.raises(ValueError, match="cycle 5 does not follow 3"):
        traffic.advance(5)
    with pytest.raises(ValueError, match="not in the net"):
        traffic.release("1.1")


def platoon() -> LoggedScene:
    """A host on lane 5 at 15 m/s, followers 20 m apart, cars beside it, and one that changes in behind it."""
    behind = [steady(k, [5] * 250, at=-20.0 * k) for k in range(1, 8)]
    beside = [steady(20 + k, [4] * 250, at=-20.0 * k + 7) for k in range(8)]
    late = steady(50, [5] * 150, at=-160 - 6 * 15, frame=60)
    changing = steady(40, [4] * 50 + [5] * 200, at=-63)
    return scene_of(steady(99, [5] * 250, at=0), *behind, *beside, changing, late)


def stop_the_host(scene: LoggedScene, release: bool) -> tuple[LoggedTraffic, float]:
    """Let car 99 brake to a stop from cycle 20 on, and return the deepest overlap with any car off its log [m]."""
    traffic = LoggedTraffic(Session(libsumo), scene, RAMP)
    deepest, speed = -np.inf, 15.0
    for cycle in range(scene.cycles):
        if cycle == 20:
            traffic.take_over("99.1")
        if cycle >= 20:
            speed = max(speed - 0.4, 0.0)
            libsumo.vehicle.setSpeed("99.1", speed)
            if release:
                traffic.release_near("99.1")
        traffic.advance(cycle)
        libsumo.simulationStep()
        places = shown()
        for off in {"99.1", *traffic.released} & set(places):
            lane, x = places[off]
            others = [other for name, (on, other) in places.items() if on == lane and name != off]
            deepest = max([deepest, *(4.0 - abs(x - other) for other in others)])
    assert libsumo.vehicle.getSpeed("99.1") == 0.0
    return traffic, deepest


@pytest.mark.usefixtures("sumo")
def test_logged_cars_drive_through_a_host_that_stops() -> None:
    traffic, deepest = stop_the_host(platoon(), release=False)
    assert (traffic.taken, traffic.released, traffic.blocked) == (["99.1"], [], [])
    assert deepest > 3.0


@pytest.mark.usefixtures("sumo")
def test_nobody_drives_through_a_host_that_stops_once_cars_are_released() -> None:
    traffic, deepest = stop_the_host(platoon(), release=True)
    assert deepest <= 0.0
    assert set(traffic.released) >= {f"{k}.1" for k in range(1, 8)}
    assert traffic.taken == ["99.1"]


@pytest.mark.usefixtures("sumo")
def test_released_cars_stop_behind_a_host_where_they_cannot_pass() -> None:
    ramp = [steady(k, [7] * 200, at=-120 - 20.0 * (k if k < 99 else 0)) for k in (99, 1, 2, 3, 4, 5, 6)]
    traffic, deepest = stop_the_host(scene_of(*ramp), release=True)
    assert deepest <= 0.0
    assert sorted(traffic.released) == [f"{k}.1" for k in range(1, 7)]
    x = [shown()[f"{k}.1"][1] for k in (99, 1, 2, 3, 4, 5, 6)]
    gaps = -np.diff(x) - 4.0
    assert np.all((gaps > 0.5) & (gaps < 6.0)), gaps
    assert all(libsumo.vehicle.getSpeed(f"{k}.1") < 0.2 for k in range(1, 7))


@pytest.mark.usefixtures("sumo")
def test_what_is_near_a_host_is_released_unless_it_is_kept() -> None:
    places = {1: (5, 29.0), 2: (4, 31.0), 3: (4, -59.0), 4: (5, -61.0), 5: (6, 20.0), 6: (3, 1.0), 7: (4, 1.0)}
    cars = [steady(number, [lane] * 30, at=50 + x) for number, (lane, x) in places.items()]
    traffic = LoggedTraffic(Session(libsumo), scene_of(steady(99, [5] * 30, at=50), *cars), RAMP)
    traffic.advance(0)
    libsumo.simulationStep()
    traffic.take_over("99.1")
    assert traffic.release_near("99.1", ahead=30, behind=60, keep=("7.1",)) == ["1.1", "3.1", "5.1"]
    assert traffic.release_near("99.1", ahead=30, behind=60) == ["7.1"]
    assert traffic.driven == ["2.1", "4.1", "6.1"]
    assert libsumo.vehicle.getSpeedMode("7.1") == 31
    assert libsumo.vehicle.getLaneChangeMode("7.1") == 1621


@pytest.mark.usefixtures("sumo")
def test_no_car_comes_in_where_another_stands_nor_twice() -> None:
    scene = scene_of(
        steady(1, [3] * 10, at=0),
        steady(1, [3] * 10, at=0, frame=20, part=2),  # its log goes on after a gap
        steady(2, [3] * 10, at=-35.0, frame=20),  # close behind it when it comes in
        steady(3, [3] * 10, at=-200.0, frame=20),
        steady(4, [3] * 10, at=-23.0, frame=20),  # close ahead of it
        steady(5, [3] * 10, at=-15.0, frame=20),
    )
    traffic = LoggedTraffic(Session(libsumo), scene, RAMP)
    for cycle in range(scene.cycles):
        traffic.advance(cycle)
        libsumo.simulationStep()
        if cycle == 1:
            traffic.take_over("1.1")
            libsumo.vehicle.setSpeed("1.1", 0.0)
    assert sorted(traffic.blocked) == ["1.2", "2.1", "4.1"]
    assert sorted(shown()) == ["1.1", "3.1", "5.1"]

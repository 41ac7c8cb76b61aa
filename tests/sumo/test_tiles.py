"""Tiles under a real SUMO: cars that are driven by speed stay exactly where their path coordinate says."""

import gzip
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import libsumo
import numpy as np
import pytest
import sumolib

from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.lane_map import LaneMap, LanePosition
from merge_cosim.sumo.tiles import tile_id, tile_net

ALL = ("designed", "i80", "us101")
CARS = ("host", "merging")


@contextmanager
def running(net: Path, ramp: Ramp, tile: str, *options: str) -> Iterator[None]:
    """A SUMO with one host and one merging car, whose edge ids carry the prefix `tile`."""
    words = ["sumo", "--net-file", str(net), "--step-length", "0.1", "--time-to-teleport", "-1"]
    libsumo.start([*words, "--collision.action", "none", "--no-step-log", "--no-warnings", *options])
    try:
        libsumo.vehicletype.copy("DEFAULT_VEHTYPE", "controlled")
        libsumo.vehicletype.setSpeedDeviation("controlled", 0.0)
        libsumo.vehicletype.setImperfection("controlled", 0.0)
        for car, route in zip(CARS, (ramp.main_route, ramp.ramp_route), strict=True):
            libsumo.route.add(car, [tile + edge for edge in route])
            libsumo.vehicle.add(car, car, "controlled", departPos="10", departSpeed="0")
            libsumo.vehicle.setSpeedMode(car, 32)
            libsumo.vehicle.setLaneChangeMode(car, 0)
            libsumo.vehicle.setSpeed(car, 0.0)
        libsumo.simulationStep()
        assert sorted(libsumo.vehicle.getIDList()) == sorted(CARS)
        yield
    finally:
        libsumo.close()


def drive(ramp: Ramp, tile: str, seed: int, cycles: int = 250) -> float:
    """Put both cars at a random start, drive hard random speeds; the worst deviation of station, odometer and speed."""
    rng = np.random.default_rng(seed)
    merge_position = ramp.merging_point
    station = {car: float(rng.uniform(-150.0, -5.0)) for car in CARS}
    speed = {car: float(rng.uniform(0.0, 28.0)) for car in CARS}
    start, odometer = dict(station), {}
    for car, path in zip(CARS, ("main", "ramp"), strict=True):
        where = LaneMap(ramp).place(path, station[car], merge_position)
        libsumo.vehicle.moveTo(car, f"{tile}{where.edge}_{where.lane}", where.position)
        libsumo.vehicle.setPreviousSpeed(car, speed[car])
        odometer[car] = libsumo.vehicle.getDistance(car)
    worst, changed = 0.0, not ramp.changes_lane
    for _ in range(cycles):
        for car in CARS:
            speed[car] = float(np.clip(speed[car] + rng.uniform(-0.9, 1.0), 0.0, 29.0))
            libsumo.vehicle.setSpeed(car, speed[car])
        if not changed and station["merging"] + speed["merging"] * 0.1 >= 0.0:
            edge = libsumo.vehicle.getRoadID("merging").removeprefix(tile)
            libsumo.vehicle.changeLane("merging", LaneMap(ramp).host_lane(edge), 0.0)
        libsumo.simulationStep()
        for car in CARS:
            station[car] += speed[car] * 0.1
            edge = libsumo.vehicle.getRoadID(car).removeprefix(tile)
            lane, position = libsumo.vehicle.getLaneIndex(car), libsumo.vehicle.getLanePosition(car)
            seen = LaneMap(ramp).station(LanePosition(edge, lane, position), merge_position)
            driven = libsumo.vehicle.getDistance(car) - odometer[car]
            worst = max(worst, abs(seen - station[car]), abs(driven - (station[car] - start[car])))
            worst = max(worst, abs(libsumo.vehicle.getSpeed(car) - speed[car]))
        if not changed and station["merging"] >= 0.0:
            assert lane == LaneMap(ramp).host_lane(edge), "the lane change acts within the step"
            changed = True
    return worst


@pytest.mark.parametrize("name", ALL)
def test_cars_that_are_moved_back_again_and_again_stay_exact(name: str) -> None:
    ramp = Ramp.load(name)
    with running(tile_net(ramp, 3), ramp, tile_id(2, "")):
        assert max(drive(ramp, tile_id(2, ""), seed) for seed in range(12)) < 1e-9


@pytest.mark.parametrize("name", ALL)
def test_the_whole_net_without_internal_links_gives_the_same(name: str) -> None:
    ramp = Ramp.load(name)
    with running(ramp.net, ramp, "", "--no-internal-links", "true"):
        assert max(drive(ramp, "", seed) for seed in range(3)) < 1e-9


def test_the_odometer_must_be_read_after_a_move() -> None:
    """A move changes the odometer by some lane difference, not by the way along the path; from then on it is exact."""
    ramp = Ramp.load("us101")
    with running(tile_net(ramp, 1), ramp, tile_id(0, "")):
        for lane, position in (("main_in_0", 300.0), ("main_out_0", 50.0), ("main_in_0", 20.0), ("weave_1", 211.5)):
            libsumo.vehicle.moveTo("host", tile_id(0, lane), position)
            before = libsumo.vehicle.getDistance("host")
            libsumo.vehicle.setSpeed("host", 10.0)
            for _ in range(20):
                libsumo.simulationStep()
            assert libsumo.vehicle.getDistance("host") == pytest.approx(before + 20.0, abs=1e-9)


def test_a_lane_change_may_be_asked_for_just_before_the_auxiliary_lane_begins() -> None:
    ramp = Ramp.load("us101")
    with running(tile_net(ramp, 1), ramp, tile_id(0, "")):
        libsumo.vehicle.moveTo("merging", tile_id(0, "ramp_0"), 499.5)
        libsumo.vehicle.setSpeed("merging", 20.0)
        libsumo.vehicle.changeLane("merging", LaneMap(ramp).host_lane("weave"), 0.0)
        libsumo.simulationStep()
        assert libsumo.vehicle.getLaneID("merging") == tile_id(0, "weave_1")
        assert libsumo.vehicle.getLanePosition("merging") == pytest.approx(1.5, abs=1e-12)


def test_a_move_to_the_lane_beside_is_a_lane_change_too() -> None:
    ramp = Ramp.load("us101")
    with running(tile_net(ramp, 1), ramp, tile_id(0, "")):
        libsumo.vehicle.moveTo("merging", tile_id(0, "weave_0"), 40.0)
        before = libsumo.vehicle.getDistance("merging")
        libsumo.vehicle.moveTo("merging", tile_id(0, "weave_1"), 40.0)
        libsumo.vehicle.setSpeed("merging", 12.0)
        libsumo.simulationStep()
        assert libsumo.vehicle.getLaneID("merging") == tile_id(0, "weave_1")
        assert libsumo.vehicle.getLanePosition("merging") == pytest.approx(41.2, abs=1e-12)
        assert libsumo.vehicle.getDistance("merging") == pytest.approx(before + 1.2, abs=1e-12)


@pytest.mark.parametrize("name", ALL)
def test_tiles_hold_what_the_paths_use(name: str) -> None:
    ramp = Ramp.load(name)
    net = sumolib.net.readNet(str(tile_net(ramp, 5)), withInternal=True)
    assert len(net.getEdges()) == 5 * len({*ramp.main_route, *ramp.ramp_route})
    for tile in range(5):
        for section in ramp.main + ramp.ramp:
            edge = net.getEdge(tile_id(tile, section.edge))
            assert edge.getLength() == section.length
            assert section.lane < edge.getLaneNumber()
    reach = net.getReachable(net.getEdge(tile_id(1, "main_in")))
    assert {edge.getID().split(".")[0] for edge in reach} == {"t1"}


def build_in_another_process(_: int) -> str:
    return str(tile_net(Ramp.load("us101"), 7))


def test_processes_may_build_the_same_tiles_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MERGE_COSIM_CACHE", str(tmp_path))
    with get_context("spawn").Pool(2) as pool:
        paths = set(pool.map(build_in_another_process, range(4), chunksize=1))
    assert [str(path) for path in (tmp_path / "tiles").glob("*.xml")] == list(paths)


def test_a_compressed_net_makes_the_same_tiles(tmp_path: Path) -> None:
    ramp = Ramp.load("i80")
    packed = tmp_path / "i80.net.xml.gz"
    packed.write_bytes(gzip.compress(ramp.net.read_bytes()))
    assert tile_net(replace(ramp, net=packed), 2).read_bytes() == tile_net(ramp, 2).read_bytes()

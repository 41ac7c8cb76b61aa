"""The loop: SUMO moves as the closed form does, and no case feels its tile, its batch or its neighbours."""

import numpy as np
import pytest
from cases import random_encounters

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import controllers
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Setting
from merge_cosim.estimators.base import estimators
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.leader import LeaderRule
from merge_cosim.simulation.loop import Loop, Run
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.simulation.worlds.tiles import TiledWorld
from merge_cosim.sumo.lane_map import LaneMap


def run(world, encounters: Encounters, method: str, traced=()) -> Run:
    estimator = estimators[method]()
    if estimator.needs_model:
        estimator.use(IntentionModel.load("us101-ngsim"))
    driver = HostDriver(estimator, controllers[estimator.default_controller]())
    return Loop(world, encounters, driver, merging_cars["designed"](), Rules(), Setting(), traced).run()


def on_sumo(ramp: str, tiles: int, encounters: Encounters, method: str, traced=()) -> Run:
    world = TiledWorld(Ramp.load(ramp), tiles)
    try:
        return run(world, encounters, method, traced)
    finally:
        world.close()


def assert_same(one: Run, other: Run) -> None:
    for name, column in one.columns.items():
        np.testing.assert_array_equal(column, other.columns[name], err_msg=name)


@pytest.mark.parametrize(("ramp", "merge_position"), [("designed", 0.0), ("us101", 41.0), ("i80", 63.0)])
def test_sumo_drives_as_the_closed_form_does(ramp, merge_position):
    encounters = random_encounters(200, seed=1, merge_position=merge_position)
    sumo = on_sumo(ramp, 32, encounters, "acc")
    assert sumo.effort.worst_difference_m < 1e-6
    closed = run(ClosedFormWorld(32), encounters, "acc")
    np.testing.assert_allclose(sumo.columns["end_station"], closed.columns["end_station"], atol=1e-6)
    np.testing.assert_array_equal(sumo.columns["kind"], closed.columns["kind"])


@pytest.mark.parametrize(("ramp", "merge_position"), [("designed", 0.0), ("us101", 41.0)])
def test_speeds_are_those_that_sumo_reports(ramp, merge_position):
    import libsumo

    encounters = random_encounters(16, seed=6, merge_position=merge_position)
    road = Ramp.load(ramp)
    world = TiledWorld(road, 16)
    rng = np.random.default_rng(6)
    world.start(encounters, Setting(), Rules(), LeaderRule(Acc(), Setting()), 0)
    try:
        for _ in range(2):  # the second time the cars come from where the first encounters ended
            world.place(np.arange(16), np.arange(16))
            for _ in range(120):  # across edges and the lane change
                world.command(rng.uniform(0, 30, (2, 16)))
                world.step()
                for role, speeds in zip(("host", "merging"), world.state[2:], strict=True):
                    reported = [libsumo.vehicle.getSpeed(f"{role}.{tile:02}") for tile in range(16)]
                    np.testing.assert_allclose(speeds, reported, atol=1e-9)
                if road.changes_lane:  # in the very cycle in which the front is there
                    lanes = [libsumo.vehicle.getLaneID(f"merging.{tile:02}") for tile in range(16)]
                    edges = [lane.partition(".")[2].rpartition("_")[0] for lane in lanes]
                    in_host_lane = [
                        edge in road.main_route and lane.endswith(f"_{LaneMap(road).host_lane(edge)}")
                        for lane, edge in zip(lanes, edges, strict=True)
                    ]
                    np.testing.assert_array_equal(in_host_lane, world.state[1] >= -1e-6)
    finally:
        world.close()


@pytest.mark.parametrize("method", ["slot", "pgm", "ipcb", "dbn-pf"])
def test_tile_count_does_not_matter(method):
    encounters = random_encounters(40, seed=2)
    reference = on_sumo("designed", 1, encounters, method)
    for tiles in (7, 32, 64):  # all but the last have to take slots again
        assert_same(reference, on_sumo("designed", tiles, encounters, method))


def test_order_and_neighbours_do_not_matter():
    encounters = random_encounters(60, seed=3)
    order = np.random.default_rng(0).permutation(60)
    straight = on_sumo("designed", 16, encounters, "pgm")
    shuffled = on_sumo("designed", 16, encounters.take(order), "pgm")
    for name, column in straight.columns.items():
        np.testing.assert_array_equal(column[order], shuffled.columns[name], err_msg=name)


def test_a_case_alone_ends_as_in_its_batch_and_can_be_traced():
    encounters = random_encounters(40, seed=4)
    batch = on_sumo("designed", 16, encounters, "acc", traced={"r5"})
    alone = on_sumo("designed", 1, encounters.take(np.array([5])), "acc", traced={"r5"})
    for name, column in batch.columns.items():
        np.testing.assert_array_equal(column[5:6], alone.columns[name], err_msg=name)
    for run in (batch, alone):
        cycles = run.columns["end_cycle"].sum()
        assert (run.effort.encounter_cycles, run.effort.vehicle_steps) == (cycles, 2 * cycles)
    trace = alone.traces["r5"]
    assert batch.traces["r5"].equals(trace)
    assert len(trace["time_s"]) == alone.columns["end_cycle"][0]
    assert trace["host_station_m"][0] == np.round(encounters.host_station[5], 6)
    assert trace["time_s"][:4].tolist() == [0.0, 0.1, 0.2, 0.3]
    # one cycle of the trace obeys the law of motion
    assert trace["host_station_m"][1] == pytest.approx(
        trace["host_station_m"][0] + 0.1 * trace["host_speed_m_s"][1], abs=2e-6
    )


@pytest.mark.parametrize(
    ("method", "start", "before", "after"),
    [
        ("always-go", (-60.0, 20.0, -2.0, 5.0), 2.0, -4.0),  # free until a slow car is in the lane ahead
        ("always-yield", (-1.0, 10.0, -8.0, 10.0), -4.0, 2.0),  # keeps behind, until the other is behind for good
    ],
)
def test_a_car_in_the_lane_is_followed_iff_it_is_ahead_whatever_is_believed(method, start, before, after):
    case = Encounters.unlogged(
        np.array(["c"]),
        "designed",
        "designed",
        **dict(zip(("host_station", "host_speed", "merging_station", "merging_speed"), start, strict=True)),
        host_length=5.0,
        merging_length=5.0,
    )
    trace = run(ClosedFormWorld(1), case, method, traced={"c"}).traces["c"]
    in_lane = np.array(trace["merging_station_m"]) >= 0
    first = int(np.argmax(in_lane))
    assert 0 < first < 20
    np.testing.assert_allclose(trace["host_acceleration_m_s2"][:first], before, atol=1e-4)
    assert trace["host_acceleration_m_s2"][first] == pytest.approx(after, abs=1e-4)


def test_sumo_reports_the_overlaps_of_the_designed_ramp():
    encounters = random_encounters(300, seed=5)
    result = on_sumo("designed", 64, encounters, "always-go")
    failed = result.columns["kind"] > 0
    assert failed.sum() > 5
    # SUMO's contact is counted only where the bodies meet on one edge: see docs/collisions.md
    assert (failed != (result.columns["sumo_collision"] > 0)).sum() <= 0.05 * failed.sum() + 1

"""What must hold in every run: each invariant is broken here by a run that really breaks it, and counted."""

import numpy as np
import pytest
from cases import random_encounters
from command import SMALL, merge_cosim
from living import drive, us101, vehicle

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.references import AlwaysGo
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.invariants import checked
from merge_cosim.results.rows import result_rows
from merge_cosim.results.store import MANIFEST, ResultFolder
from merge_cosim.scoring.invariants import INVARIANTS, Bounds, broken
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.tracks import Tracks
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Loop, Run
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.simulation.worlds.tiles import TiledWorld

COUNT = 20


class Hasty(Acc):
    """Commands what its bounds forbid, on the hosts of every fifth slot."""

    commanded = 0.0

    def command(self, seen, log_odds, target):
        acceleration = super().command(seen, log_odds, target)
        return np.where(np.arange(len(acceleration)) % 5 == 0, self.commanded, acceleration)


def run(world, controller=None, merge_position=0.0) -> Run:
    encounters = random_encounters(COUNT, seed=3, merge_position=merge_position)
    driver = HostDriver(AlwaysGo(), controller or Acc())
    try:
        return Loop(world, encounters, driver, merging_cars["designed"](), Rules(), Setting()).run()
    finally:
        world.close()


@pytest.mark.parametrize(
    ("commanded", "expected"),
    [(-3.9, set()), (-4.2, {"acceleration"}), (2.1, {"acceleration"}), (990.0, {"acceleration", "speed"})],
)
def test_a_controller_that_leaves_its_bounds(commanded, expected):
    controller = Hasty()
    controller.commanded = commanded
    found = run(ClosedFormWorld(COUNT), controller).broken
    assert set(found) == expected
    for where in found.values():
        assert where.sum() == COUNT / 5  # those that it was commanded to, and no other


def test_a_standing_car_that_is_set_back_before_its_lane_change_is_no_jump():
    """Of `TrafficWorld.settled` 2e-6 m, and 1e-6 m of two rounded stations; ten times that is one."""
    for back, expected in ((3e-6, set()), (3e-5, {"jump"})):
        merging = np.array([-back, 0.0, 0.0])
        states = Observation(np.arange(3.0), np.full(3, 10.0), merging, np.zeros(3), np.full(3, 5.0), np.full(3, 5.0))
        tracks = Tracks(states, np.zeros(3), np.zeros(1, np.int64), np.array([2]), {})
        assert set(broken(tracks, Bounds(), Bounds())) == expected


def meddled(meddle, at=30) -> Run:
    """A run on US-101's tiles in which SUMO gets another command once."""
    world = TiledWorld(Ramp.load("us101"), COUNT)
    step, cycles = world.session.step, iter(range(10_000))

    def meddled_step():
        step()
        if next(cycles) == at:
            meddle(world.session)

    world.session.step = meddled_step
    return run(world, merge_position=41.0)


def test_nothing_is_broken_where_nobody_meddles():
    assert meddled(lambda session: None).broken == {}


def test_a_car_that_is_put_elsewhere():
    def teleport(session):
        lane, position = session.lane("merging.03"), session.lane_position("merging.03")
        session.place("merging.03", lane, position + 5.0)

    broken = meddled(teleport).broken
    assert set(broken) == {"acceleration", "closed_form"}
    assert all(where.sum() == 1 for where in broken.values())


def test_a_car_on_the_wrong_lane():
    def astray(session):
        edge = session.lane("host.03").rpartition("_")[0]
        assert edge == "t3.weave"
        session.place("host.03", "t3.weave_0", session.lane_position("host.03"))

    broken = meddled(astray, at=60).broken
    assert set(broken) == {"lane"}
    assert broken["lane"].sum() == 1


@pytest.mark.parametrize(("length", "expected"), [(4.8, 0), (60.0, 8)])
def test_a_contact_that_sumo_alone_reports(length, expected):
    """For SUMO the hosts become longer than they are: merging cars that come behind them are in contact with them."""

    def lengthen(session):
        for tile in range(COUNT):
            session.set_length(f"host.{tile:02}", length)

    run = meddled(lengthen)
    rows = result_rows(run, run.encounters, Setting(), Acc(), dict.fromkeys(("scenario", "variation", "method"), ""))
    only_sumo = [row["case"] for row in rows.to_pylist() if row["sumo_collision"] and not row["failed"]]
    assert len(only_sumo) == expected
    found = checked(run, rows)
    assert found["broken"] == ({"contact": expected} if expected else {})
    assert found["first"] == ({"contact": min(only_sumo)} if expected else {})


@pytest.mark.parametrize(("way", "expected"), [(8.0, {"jump"}), (-8.0, {"jump", "station"})])
def test_a_teleport_in_living_traffic(tmp_path, way, expected):
    cars = (vehicle("h", "host", 440, 20), vehicle("m", "merging", 470, 20, route="ramp"))
    with us101(tmp_path, *cars) as (api, driven):

        def each(cycle):
            if cycle == 20:
                api.vehicle.moveTo("h", api.vehicle.getLaneID("h"), api.vehicle.getLanePosition("h") + way)
                api.vehicle.setPreviousSpeed("h", api.vehicle.getSpeed("h"))

        drive(api, driven, 200, each)
        found = driven.close()
    assert len(found.encounters) == 1
    assert set(found.broken) == expected


PLUGIN = """
import numpy as np
import merge_cosim as mc
from merge_cosim.controllers.acc import Acc

@mc.controller
class Hard(Acc):
    name = "hard"
    def command(self, seen, log_odds, target):
        return np.full(len(seen.host_speed), -9.0)
"""


def test_a_broken_invariant_is_counted_and_reported(tmp_path):
    (tmp_path / "hard.py").write_text(PLUGIN)
    (tmp_path / "small.toml").write_text(SMALL)
    words = ("sweep", "small.toml", "--plugin", "hard.py", "--world", "closed-form", "--out", "out", "--method")
    done = merge_cosim(*words, "always-go+hard,acc", cwd=tmp_path)
    line = (
        f"broken invariant 'acceleration' ({INVARIANTS['acceleration']}): 75 of 150 encounters, such as small "
        "always-go+hard d+0_h10_m10"
    )
    assert (done.returncode, done.stderr.strip()) == (0, line)
    counted = ResultFolder(tmp_path / "out").read_json(MANIFEST)["invariants"]
    assert counted["broken"] == dict.fromkeys(INVARIANTS, 0) | {"acceleration": 75}
    added = merge_cosim(
        "sweep", "small.toml", "--world", "closed-form", "--out", "out", "--add", "--method", "always-go", cwd=tmp_path
    )
    assert line.replace("150", "225") in added.stderr
    alone = merge_cosim(
        "run", "small.toml", "--case", "d+0_h25_m25", "--plugin", "hard.py", "--method", "always-go+hard", cwd=tmp_path
    )
    assert "broken invariant 'acceleration'" in alone.stdout.splitlines()[-1]


def test_a_car_that_leaves_the_net_before_its_case_is_over(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    words = ("--set", "test.horizon=60", "--set", "test.time_out=200", "--method", "always-go", "--jobs", "1")
    done = merge_cosim("sweep", "small.toml", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "has left the net, which ends 1500 m past the gore, before the case was over" in done.stderr

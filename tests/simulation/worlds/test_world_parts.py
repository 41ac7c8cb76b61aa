"""Parts of the worlds by themselves; tests/simulation/worlds/test_traffic.py drives them in a real SUMO."""

import numpy as np
import pytest

from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.worlds.actors import Actor
from merge_cosim.simulation.worlds.base import World
from merge_cosim.simulation.worlds.logged import LoggedWorld
from merge_cosim.simulation.worlds.meetings import MARGIN, Meeting
from merge_cosim.simulation.worlds.scene import Scene
from merge_cosim.simulation.worlds.tiles import TiledWorld
from merge_cosim.simulation.worlds.traffic import TrafficWorld
from merge_cosim.sumo.lane_map import LaneMap, Part
from merge_cosim.sumo.logged_road import LoggedRoad


@pytest.mark.parametrize("world", [TiledWorld, LoggedWorld, TrafficWorld])
def test_a_world_has_all_that_the_loop_asks_for(world):
    assert issubclass(world, World)
    assert not world.__abstractmethods__


def test_an_actor_is_on_the_part_of_its_lane():
    actor = Actor("host.0", 5.0)
    assert (actor.copy, actor.is_on(Part.HOST)) == ("", False)
    actor.lane = LaneMap(Ramp.load("us101"))["t3.weave_1"]
    assert (actor.copy, actor.is_on(Part.HOST), actor.is_on(Part.MERGING)) == ("t3", True, False)


def test_the_merging_point_is_where_cars_merge_until_the_car_is_past_it_or_has_merged():
    meeting = Meeting(Actor("h", 5.0), Actor("m", 5.0, x=10.0), 0, 0, (0.0, 20.0, 10.0, 18.0))
    assert meeting.name == "h/m"
    assert meeting.merging_point(42.0) == 42.0
    meeting.merging.x = 60.0
    assert meeting.merging_point(42.0) == 60.0 + MARGIN
    meeting.merged_at, meeting.merge_position = 7, 55.0
    assert meeting.merging_point(42.0) == 55.0


def test_a_scene_is_opened_by_its_file(tmp_path):
    ramp = Ramp.load("us101")
    (tmp_path / "one.rou.xml").write_text(
        '<routes><vType id="host"><param key="merge-cosim.role" value="host"/></vType><vehicle id="h" type="host" '
        'depart="0" departSpeed="20"><route edges="main_in weave main_out"/></vehicle></routes>'
    )
    file = tmp_path / "one.sumocfg"
    file.write_text(
        f'<configuration><net-file value="{ramp.net}"/><route-files value="one.rou.xml"/>'
        '<no-internal-links value="true"/><step-length value="0.1"/></configuration>'
    )
    scene = Scene("000", file, ramp, seed=0, end=5.0)
    with scene.opened() as world:
        for _ in range(10):
            world.step()
        facts = scene.facts(world)
    assert facts["simulated_s"] == pytest.approx(1.0)
    assert (facts["throughput_veh_h"], facts["meetings"], facts["mean_speed"]) == (0.0, 0, None)


def test_places_of_a_recording_lie_on_lanes_of_the_net():
    road = LoggedRoad(Ramp.load("us101"), [6, 7], [8], 5)
    strips = [road.strips[number] for number in road.find(np.array([5, 5, 6]), np.array([-20.0, 100.0, 100.0]))]
    assert [strip.id for strip in strips] == ["main_in_0", "weave_1", "weave_0"]
    before, beside, side = strips
    assert road.at("weave_1") == beside
    assert road.at("nowhere_0") is None
    assert road.drivable(before, beside)
    assert road.drivable(beside, side)
    assert not road.drivable(beside, before)
    assert road.onward(before, from_ramp=False) == ("weave", "main_out")
    assert road.onward(side, from_ramp=False) == ("exit",)
    assert road.onward(side, from_ramp=True) == ("main_out",)

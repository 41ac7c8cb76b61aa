"""Ramps from a few numbers: what comes out has no problem, has the numbers, and SUMO drives on it."""

from pathlib import Path

import pytest
import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.check import check
from merge_cosim.ramps.create.new import RampNumbers, new_ramp
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.lane_map import LaneMap, LanePosition
from merge_cosim.sumo.tiles import tile_net


@pytest.mark.parametrize(
    ("numbers", "merging_point", "place"),
    [
        (RampNumbers(), 0.0, LanePosition("ramp", 0, 480.0)),
        (RampNumbers(lanes=3), 0.0, LanePosition("ramp", 0, 480.0)),
        (RampNumbers(lanes=2, acceleration_lane=200.0), 40.0, LanePosition("merge", 0, 20.0)),
        (RampNumbers(lanes=4, ramp_lanes=2, acceleration_lane=300.0), 60.0, LanePosition("merge", 1, 40.0)),
        (RampNumbers(upstream=450.0, downstream=1800.0, speed_limit=25.0), 0.0, LanePosition("ramp", 0, 430.0)),
    ],
)
def test_what_comes_out_has_the_numbers(
    tmp_path: Path, numbers: RampNumbers, merging_point: float, place: LanePosition
) -> None:
    folder = new_ramp(tmp_path / "mine", numbers)
    assert check(folder) == []
    ramp = Ramp.load(folder)
    assert ramp.merging_point == merging_point
    assert (ramp.upstream, ramp.downstream) == (numbers.upstream, numbers.downstream)
    assert ramp.changes_lane == bool(numbers.acceleration_lane)
    assert LaneMap(ramp).place("ramp", -20.0, merging_point) == place
    net = sumolib.net.readNet(str(ramp.net))
    assert [net.getEdge(edge).getLaneNumber() for edge in ("main_in", "ramp", "main_out")] == [
        numbers.lanes,
        numbers.ramp_lanes,
        numbers.lanes,
    ]
    assert sumolib.net.readNet(str(tile_net(ramp, 2))).hasEdge("t1.main_out")


def test_an_acceleration_lane_too_short_to_brake_in_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="50 m of auxiliary lane after it, but 53 m to brake in"):
        new_ramp(tmp_path / "mine", RampNumbers(acceleration_lane=50.0))
    assert not (tmp_path / "mine").exists()
    # Where a fifth would leave too little, the merging point is as far on as braking allows: 60 - 29^2 / 16 = 7.
    folder = new_ramp(tmp_path / "mine", RampNumbers(acceleration_lane=60.0))
    assert Ramp.load(folder).merging_point == 7.0


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        (RampNumbers(ramp_lanes=2), "2 ramp lanes cannot end in one lane; give --acceleration-lane"),
        (RampNumbers(acceleration_lane=1500.0), "make --downstream longer"),
    ],
)
def test_numbers_that_make_no_ramp_are_reported(tmp_path: Path, numbers: RampNumbers, message: str) -> None:
    with pytest.raises(UserError, match=message):
        new_ramp(tmp_path / "mine", numbers)

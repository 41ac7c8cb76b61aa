"""Following one road through a small net, lane by lane."""

from pathlib import Path

import sumolib

from merge_cosim.ramps.build import netconvert
from merge_cosim.ramps.create.new import RampNumbers, new_ramp
from merge_cosim.ramps.paths import follow, has_cars, keeps_left, road_class, turn
from merge_cosim.ramps.picture import PICTURE, draw


def test_a_straight_ramp_is_followed_both_ways_and_drawn(tmp_path: Path) -> None:
    folder = new_ramp(tmp_path / "mine", RampNumbers(lanes=2, acceleration_lane=250.0))
    net = sumolib.net.readNet(str(folder / "mine.net.xml"))
    start, gore = net.getEdge("main_in").getLane(0), net.getEdge("merge")
    down = follow(start, 5000.0)
    assert [lane.getID() for lane in down.lanes] == ["main_in_0", "merge_1", "main_out_0"]
    assert (down.passed, down.stop) == ((), "the road ends with 'main_out'")
    assert follow(start, 100.0).stop == ""
    up = follow(gore.getLane(2), 600.0, back=True)
    assert [lane.getID() for lane in up.lanes] == ["merge_2", "main_in_1"]
    dead_end = follow(gore.getLane(0), 500.0)
    assert dead_end.stop == "the lane ends with 'merge'"
    assert (turn(net.getEdge("main_in"), gore), has_cars(gore), keeps_left(gore), road_class(gore)) == (
        0,
        True,
        False,
        -1,
    )
    picture = folder / PICTURE
    assert picture.is_file()
    picture.unlink()
    assert draw(folder) == picture
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_net_of_left_hand_traffic_is_known_by_its_lanes(tmp_path: Path) -> None:
    folder, mirrored = new_ramp(tmp_path / "mine", RampNumbers(lanes=2)), tmp_path / "left.net.xml"
    netconvert(folder, "-c", str(folder / "mine.netccfg"), "--lefthand", "-o", str(mirrored))
    assert keeps_left(sumolib.net.readNet(str(mirrored)).getEdge("main_in"))

"""What SUMO's lanes mean on a ramp."""

import pytest

from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.lanes import Part, RampLane, RampLanes


@pytest.mark.parametrize(
    ("lane", "expected"),
    [
        ("main_in_0", RampLane("", -500.0, Part.HOST)),
        ("main_in_1", RampLane("", -500.0, Part.BESIDE)),
        ("ramp_0", RampLane("", -500.0, Part.MERGING)),
        ("weave_0", RampLane("", 0.0, Part.MERGING)),
        ("weave_1", RampLane("", 0.0, Part.HOST)),
        ("main_out_0", RampLane("", 213.0, Part.HOST)),
        ("t12.weave_0", RampLane("t12", 0.0, Part.MERGING)),
        ("exit_0", None),
        (":gore_0_0", None),
        ("", None),
    ],
)
def test_lanes_of_us101(lane, expected):
    assert RampLanes(Ramp.load("us101"))[lane] == expected


def test_who_comes_by_the_ramp():
    lanes = RampLanes(Ramp.load("us101"))
    assert lanes.comes_by_ramp(("ramp", "weave", "main_out"))
    assert lanes.comes_by_ramp(("t3.ramp", "t3.weave"))
    assert not lanes.comes_by_ramp(("main_in", "weave", "exit"))

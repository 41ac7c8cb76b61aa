"""What SUMO's lanes mean on a ramp."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.ramp import Ramp, ramp_names
from merge_cosim.sumo.lane_map import AlongPaths, LaneMap, LanePosition, Part, RampLane


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
    assert LaneMap(Ramp.load("us101"))[lane] == expected


def test_who_comes_by_the_ramp():
    lanes = LaneMap(Ramp.load("us101"))
    assert lanes.comes_by_ramp(("ramp", "weave", "main_out"))
    assert lanes.comes_by_ramp(("t3.ramp", "t3.weave"))
    assert not lanes.comes_by_ramp(("main_in", "weave", "exit"))


def test_places_where_the_ramp_joins_by_a_connection() -> None:
    lanes = LaneMap(Ramp.load("designed"))
    assert lanes.place("main", -90.0, 0.0) == LanePosition("main_in", 0, 410.0)
    assert lanes.place("ramp", -90.0, 0.0) == LanePosition("ramp", 0, 410.0)
    assert lanes.place("ramp", 0.0, 0.0) == LanePosition("main_out", 0, 0.0)


def test_places_beside_and_past_an_auxiliary_lane() -> None:
    ramp = Ramp.load("us101")
    lanes = LaneMap(ramp)
    assert [lanes.host_lane(edge) for edge in ramp.main_route] == [0, 1, 0]
    assert lanes.place("main", -42.0, 42.0) == LanePosition("weave", 1, 0.0)
    assert lanes.place("ramp", -50.0, 42.0) == LanePosition("ramp", 0, 492.0)
    assert lanes.place("ramp", -12.0, 42.0) == LanePosition("weave", 0, 30.0)
    assert lanes.place("ramp", 8.0, 42.0) == LanePosition("weave", 1, 50.0)
    assert lanes.place("ramp", 200.0, 42.0) == LanePosition("main_out", 0, 29.0)
    assert lanes.station(LanePosition("weave", 0, 30.0), 42.0) == -12.0
    with pytest.raises(ValueError, match="'ramp' is no edge of the main road"):
        lanes.host_lane("ramp")


@given(
    name=st.sampled_from(ramp_names()),
    path=st.sampled_from(("main", "ramp")),
    station=st.floats(-400.0, 1400.0),
    share=st.floats(0.0, 1.0),
)
def test_station_is_the_inverse_of_place(name: str, path: str, station: float, share: float) -> None:
    ramp = Ramp.load(name)
    lanes = LaneMap(ramp)
    merge_position = share * (ramp.auxiliary_end if ramp.changes_lane else 0.0)
    if station + merge_position > ramp.downstream:
        return
    place = lanes.place(path, station, merge_position)
    assert lanes.station(place, merge_position) == pytest.approx(station, abs=1e-9)
    if path == "main" or station >= 0.0:
        assert place.lane == lanes.host_lane(place.edge)


def test_off_the_net_names_the_reach() -> None:
    lanes = LaneMap(Ramp.load("us101"))
    with pytest.raises(UserError, match=r"reaches from -542.0 to 1458.0 m"):
        lanes.place("main", -543.0, 42.0)
    with pytest.raises(UserError, match="off the auxiliary lane"):
        lanes.place("ramp", 0.0, 214.0)
    with pytest.raises(UserError, match="off the auxiliary lane"):
        lanes.place("ramp", 0.0, -1.0)
    with pytest.raises(ValueError, match="on neither path"):
        lanes.station(LanePosition("exit", 0, 3.0), 42.0)


def test_x_runs_on_where_cars_cross_to_the_next_edge() -> None:
    ramp = Ramp.load("us101")
    lanes, along = LaneMap(ramp), AlongPaths(ramp, 2)
    start = (("main", -10.0), ("main", 200.0), ("ramp", -1.0), ("ramp", 10.0))  # two hosts, then two merging cars
    places = [lanes.place(path, x - 42.0, 42.0) for path, x in start]
    edges = np.array([*along.numbers(0, places[:2]), *along.numbers(1, places[2:])])
    positions = np.array([place.position for place in places])
    along.put(np.arange(4), edges, positions)
    assert along.x(positions).tolist() == [x for _, x in start]
    assert along.x(np.array([2.0, 1.0, 3.0, 15.0])).tolist() == [2.0, 214.0, 3.0, 15.0]
    back = [lanes.place("main", -142.0, 42.0)]  # to a new start
    along.put(np.array([0]), np.array(along.numbers(0, back)), np.array([back[0].position]))
    assert along.x(np.array([401.0, 2.0, 4.0, 16.0])).tolist() == [-99.0, 215.0, 4.0, 16.0]
    assert along.x(np.array([402.0, 5.0]), np.array([0, 2])).tolist() == [-98.0, 215.0, 5.0, 16.0]  # the others stand

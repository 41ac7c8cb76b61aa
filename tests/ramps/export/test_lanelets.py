"""Lanelets: shared boundaries, ends that meet, lengths, and cars on them."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
import sumo

from merge_cosim.ramps.export.lanelets import lanelets
from merge_cosim.ramps.export.poses import poses
from merge_cosim.ramps.ramp import Ramp, Section, ramp_names, read_net
from merge_cosim.sumo.lane_map import LaneMap, LanePosition

TAPERS = "merge_0"
"""The lane of I-80 that runs slantwise into its neighbour."""


@pytest.fixture(scope="module", params=ramp_names())
def ramp(request):
    return Ramp.load(request.param)


def way_on(lanelet, point):
    """SUMO position [m] of the middle's point nearest to another, and how far off that is [m]."""
    middle, ways = lanelet.middle, lanelet.ways()
    steps = np.diff(middle, axis=0)
    shares = np.clip(((point - middle[:-1]) * steps).sum(axis=1) / (steps**2).sum(axis=1), 0.0, 1.0)
    off = np.hypot(*(middle[:-1] + shares[:, None] * steps - point).T)
    best = int(off.argmin())
    return ways[best] + shares[best] * (ways[best + 1] - ways[best]), off[best]


def test_neighbours_share_a_boundary_and_ends_meet(ramp):
    road = lanelets(ramp)
    links = 0
    for name, lanelet in road.items():
        assert lanelet.left.shape == lanelet.right.shape
        if lanelet.left_lane:
            assert np.array_equal(lanelet.left, road[lanelet.left_lane].right)
            assert road[lanelet.left_lane].right_lane == name
        for after in lanelet.leads_to:
            assert name in road[after].follows
            assert np.array_equal(lanelet.left[-1], road[after].left[0])
            assert np.array_equal(lanelet.right[-1], road[after].right[0])
            links += 1
    net = read_net(ramp.net)
    lanes = [net.getLane(name) for name in road]
    assert links == sum(link.getToLane().getID() in road for lane in lanes for link in lane.getOutgoing())


def test_they_are_sumos_lanes(ramp):
    net = read_net(ramp.net)
    for name, lanelet in lanelets(ramp).items():
        lane = net.getLane(name)
        if name == TAPERS:
            continue
        assert max(way_on(lanelet, np.array(point))[1] for point in lane.getShape()) < 0.06
        width = np.hypot(*(lanelet.left - lanelet.right).T)
        inner = width[1:-1]
        assert np.all(np.abs(inner - lane.getWidth()) < 0.1)
        assert np.all(width > 3.0)


def test_their_length_on_the_ground_is_sumos(ramp):
    road = lanelets(ramp)
    for section in ramp.main + ramp.ramp:
        middle = road[f"{section.edge}_{section.lane}"].middle
        assert np.hypot(*np.diff(middle, axis=0).T).sum() == pytest.approx(section.length, rel=0.005)


@pytest.mark.parametrize("path", ["main", "ramp"])
def test_a_station_is_found_again_on_the_lanelets(ramp, path):
    """Of a car without length, away from its lane change."""
    road, merge_position = lanelets(ramp), ramp.merging_point
    stations = np.array([s for s in np.arange(-300.0, 800.0, 7.3) if path == "main" or abs(s) > 20.0])
    places, headings = poses(road, ramp, path, stations, 0.0, merge_position)
    further, _ = poses(road, ramp, path, stations + 1.0, 0.0, merge_position)
    ways = further - places
    assert ways[:, 0] * np.cos(headings) + ways[:, 1] * np.sin(headings) == pytest.approx(1.0, abs=0.05)
    lanes = LaneMap(ramp)
    for station, place in zip(stations, places, strict=True):
        lane = lanes.place(path, station, merge_position)
        position, off = way_on(road[f"{lane.edge}_{lane.lane}"], place)
        assert off < 1e-6
        seen = lanes.station(LanePosition(lane.edge, lane.lane, position), merge_position)
        assert seen == pytest.approx(station, abs=1e-4)


@pytest.mark.parametrize("name", ["us101", "i80"])
def test_at_the_merging_point_the_front_is_halfway_between_the_lanes(name):
    ramp = Ramp.load(name)
    road, at = lanelets(ramp), ramp.merging_point
    (place,), _ = poses(road, ramp, "ramp", np.array([0.0]), 0.0, at)
    before, after = (road[f"{path[1].edge}_{path[1].lane}"].at(np.array([at]))[0] for path in (ramp.ramp, ramp.main))
    assert place == pytest.approx(0.5 * (before + after))


def test_the_area_from_a_position_on_is_that_part_of_the_lane():
    lanelet = lanelets(Ramp.load("designed"))["main_out_0"]
    x, y = lanelet.area_from(1400.0).T
    assert (x.min(), x.max()) == pytest.approx((1400.0, 1500.0))
    assert np.ptp(y) == pytest.approx(3.6, abs=0.05)


def test_a_connection_that_leads_sideways_is_left_out(tmp_path):
    """Two lanes to two lanes, and the right one to the left one, too."""
    ends = {"ab": -100.0, "bc": 0.0}
    files = {
        "nod": '<nodes><node id="a" x="0" y="0"/><node id="b" x="100" y="0"/><node id="c" x="200" y="0"/></nodes>',
        "edg": "<edges>"
        + "".join(f'<edge id="{e}" from="{e[0]}" to="{e[1]}" numLanes="2"/>' for e in ends)
        + "</edges>",
        "con": "<connections>"
        + "".join(f'<connection from="ab" to="bc" fromLane="{i}" toLane="{j}"/>' for i, j in ((0, 0), (1, 1), (0, 1)))
        + "</connections>",
    }
    for name, text in files.items():
        (tmp_path / f"x.{name}.xml").write_text(text)
    inputs = [word for key, name in (("-n", "nod"), ("-e", "edg"), ("-x", "con")) for word in (key, f"x.{name}.xml")]
    netconvert = Path(sumo.SUMO_HOME) / "bin/netconvert"
    subprocess.run([netconvert, *inputs, "-o", "x.net.xml"], cwd=tmp_path, check=True, capture_output=True)
    net = tmp_path / "x.net.xml"
    assert len(read_net(net).getLane("ab_0").getOutgoing()) == 2
    paths = [tuple(Section(edge, lane, start, 100.0) for edge, start in ends.items()) for lane in (1, 0)]
    road = lanelets(Ramp("x", "x", net, paths[0], paths[1], 0.0, 13.89))
    assert {name: lanelet.leads_to for name, lanelet in road.items() if name.startswith("ab")} == {
        "ab_0": ("bc_0",),
        "ab_1": ("bc_1",),
    }
    assert np.ptp(road["ab_0"].right[:, 1]) == pytest.approx(0.0, abs=0.02)

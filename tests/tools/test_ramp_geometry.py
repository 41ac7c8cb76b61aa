"""The drawn nets: lanes, widths, curve, georeference; with data, the drawing itself and how far cars are from it."""

import os
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sumolib
from geometry.lines import SURVEY_FOOT
from geometry.plain_xml import write_sources
from geometry.positions import positions
from geometry.residuals import judge
from geometry.sites import TIES
from lxml import etree
from ramp_geometry import NETS, fitted, plan_of

from merge_cosim.core.units import FOOT
from merge_cosim.ramps.definition import read_ramp_file
from merge_cosim.ramps.ramp import Ramp, read_net
from merge_cosim.ramps.view import ROLES

SITES = ("us101", "i80")
LOCAL_X_EDGES = (12.75, 24.65, 35.1, 46.9, 57.7)
"""Where the trajectories of US-101 have the right edges of lanes 1 to 5 [ft]."""
DATA = os.environ.get("MERGE_COSIM_DATA")
needs_data = pytest.mark.skipif(not DATA, reason="MERGE_COSIM_DATA is not set")


def net_of(name: str) -> sumolib.net.Net:
    return read_net(Ramp.load(name).net)


def widths(name: str, edge: str) -> list[float]:
    """Lane widths from the left [m]."""
    return [lane.getWidth() for lane in reversed(net_of(name).getEdge(edge).getLanes())]


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("us101", {"main_in": 5, "weave": 6, "main_out": 5, "ramp": 1, "exit": 1}),
        ("i80", {"main_in": 6, "merge": 7, "main_out": 6, "ramp": 1}),
    ],
)
def test_lane_counts(name: str, counts: dict[str, int]) -> None:
    assert {edge.getID(): edge.getLaneNumber() for edge in net_of(name).getEdges()} == counts


def test_lanes_of_us101_are_as_wide_as_the_trajectories_have_them() -> None:
    np.testing.assert_allclose(np.cumsum(widths("us101", "main_in")), np.array(LOCAL_X_EDGES) * FOOT, atol=0.4)
    assert widths("us101", "weave")[:5] == widths("us101", "main_in")


def test_lanes_of_i80_are_twelve_feet_wide() -> None:
    np.testing.assert_allclose(widths("i80", "merge"), 12 * FOOT, atol=0.06)


@pytest.mark.parametrize(("name", "turn"), [("us101", 6.0), ("i80", 12.0)])
def test_the_road_bends(name: str, turn: float) -> None:
    shape = np.array(net_of(name).getLane("main_in_0").getShape())
    first, last = (np.degrees(np.arctan2(*(b - a)[::-1])) for a, b in (shape[:2], shape[-2:]))
    assert abs(last - first) > turn


@pytest.mark.parametrize("name", SITES)
def test_lanes_meet_at_the_nodes_and_bend_gently(name: str) -> None:
    net = net_of(name)
    for edge in net.getEdges():
        for lane in edge.getLanes():
            shape = np.array(lane.getShape())
            heading = np.unwrap([np.arctan2(*(b - a)[::-1]) for a, b in pairwise(shape)])
            assert np.abs(np.diff(heading)).max() < np.radians(20.0), lane.getID()
            for link in lane.getOutgoing():
                assert np.hypot(*(np.array(link.getToLane().getShape()[0]) - shape[-1])) < 2.5, lane.getID()


@pytest.mark.parametrize("name", SITES)
def test_a_published_row_lies_where_its_lane_and_local_y_say(name: str) -> None:
    net, ramp = net_of(name), Ramp.load(name)
    assert ramp.ngsim is not None
    lane = net.getLane(ramp.ngsim.lanes[2][0])
    for tie in TIES[name]:
        point = np.array(tie.plane) * SURVEY_FOOT + net.getLocationOffset()
        along, distance = lane.getClosestLanePosAndDist(tuple(point))
        assert distance < lane.getWidth() / 2
        expected = lane.getLength() + tie.local[1] * FOOT - ramp.ngsim.gore_local_y
        assert along == pytest.approx(expected, abs=1.5)  # a lane off the middle of a bend is drawn shorter or longer


@pytest.mark.parametrize(
    ("name", "longitude", "latitude"),
    [("us101", (-118.37, -118.35), (34.13, 34.14)), ("i80", (-122.31, -122.29), (37.83, 37.85))],
)
def test_the_gore_lies_where_the_earth_has_it(
    tmp_path: Path, name: str, longitude: tuple[float, float], latitude: tuple[float, float]
) -> None:
    command = ["-s", str(Ramp.load(name).net), "--plain-output-prefix", str(tmp_path / "geo"), "--proj.plain-geo"]
    subprocess.run([sumolib.checkBinary("netconvert"), *command], check=True, capture_output=True)
    (node,) = etree.parse(tmp_path / "geo.nod.xml").xpath("//node[@id='gore']")
    assert longitude[0] < float(node.get("x")) < longitude[1]
    assert latitude[0] < float(node.get("y")) < latitude[1]


@pytest.mark.parametrize("name", ["designed", *SITES])
def test_every_lane_says_what_it_is_for(name: str) -> None:
    ramp = Ramp.load(name)
    roles = {lane.getID(): lane.getParam("role") for edge in read_net(ramp.net).getEdges() for lane in edge.getLanes()}
    assert set(roles.values()) <= {str(role) for role in ROLES.values()}
    for section in ramp.main:
        assert roles[f"{section.edge}_{section.lane}"] == str(ROLES["host"])
    for section in ramp.ramp:
        expected = "auxiliary" if section.start >= 0.0 else "ramp"
        assert roles[f"{section.edge}_{section.lane}"] == str(ROLES[expected])


@needs_data
@pytest.mark.parametrize("name", SITES)
def test_the_sources_are_what_the_survey_gives(tmp_path: Path, name: str) -> None:
    file = read_ramp_file(NETS / name)
    write_sources(plan_of(name, Path(str(DATA)), file), tmp_path, file.speed_limit)
    for made in tmp_path.iterdir():
        assert made.read_bytes() == (NETS / name / made.name).read_bytes(), made.name


@needs_data
@pytest.mark.parametrize("name", SITES)
def test_cars_drive_within_our_lanes(name: str) -> None:
    plan = plan_of(name, Path(str(DATA)), read_ramp_file(NETS / name))
    cars = positions(Path(str(DATA)), name)
    for rows, frame in ((cars, plan.frame), (cars[~fitted(cars)], plan.frame), (cars, plan.tied)):
        for lane in judge(Ramp.load(name), frame, rows):
            if lane.number <= 6:
                assert lane.median < 0.6, (lane.number, lane.median)

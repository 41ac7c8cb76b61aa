"""Ramps from SUMO nets: SUMO's own example nets, shipped ones, and nets that hold no ramp."""

import gzip
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sumo
import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.ramps.build import build, netconvert
from merge_cosim.ramps.check import check
from merge_cosim.ramps.create.from_net import ramp_from_net
from merge_cosim.ramps.create.new import RampNumbers, new_ramp
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.tiles import tile_net

GAMES = Path(sumo.SUMO_HOME) / "tools" / "game"
A10 = GAMES / "A10KW" / "osm.net.xml"


def test_a_real_interchange(tmp_path: Path) -> None:
    """The A10 near Koenigs Wusterhausen, which comes with SUMO: acceleration lane of 195 m, 100 km/h."""
    folder = ramp_from_net(tmp_path / "a10", A10, link="24498409")
    assert check(folder) == []
    ramp = Ramp.load(folder)
    assert ramp.main_route[2:] == ("264308383", "4054057", "264308376")
    assert [section.lane for section in ramp.main] == [0, 1, 0, 1, 0]
    assert ramp.ramp_route[:2] == ("24498409", "4054057")
    assert ramp.speed_limit == 27.78
    assert (ramp.upstream, ramp.downstream) == (pytest.approx(500.0, abs=0.011), pytest.approx(1500.0, abs=0.011))
    net, original = sumolib.net.readNet(str(ramp.net)), sumolib.net.readNet(str(A10))
    own = original.getEdge("4054057")
    # The junctions at either end, which have no length of their own here, belong to the edges.
    assert own.getLength() < ramp.auxiliary_end < own.getLength() + 8.0
    # Georeferenced: the gore is where it was on the globe, within the lanes' width.
    here = np.negative(net.getLocationOffset())
    there = np.subtract(original.getNode("21432413").getCoord(), original.getLocationOffset())
    assert np.hypot(*(here - there)) < 8.0
    assert sumolib.net.readNet(str(tile_net(ramp, 2))).hasEdge("t1.24498409")
    committed = ramp.net.read_bytes()
    assert build(folder).read_bytes() == committed


def test_any_edge_of_the_on_ramp_will_do(tmp_path: Path) -> None:
    folder = ramp_from_net(tmp_path / "a10", A10, link="151495020")  # the link before the one that joins
    assert Ramp.load(folder).ramp_route[:2] == ("151495020", "308396220")


@pytest.mark.parametrize("name", ["us101", "i80"])
def test_a_shipped_net_comes_back(tmp_path: Path, name: str) -> None:
    original = Ramp.load(name)
    folder = ramp_from_net(tmp_path / name, original.net)
    assert check(folder) == []
    again = Ramp.load(folder)
    assert (again.main_route, again.ramp_route) == (original.main_route, original.ramp_route)
    assert [section.lane for section in again.main] == [section.lane for section in original.main]
    assert [section.lane for section in again.ramp] == [section.lane for section in original.ramp]
    assert again.auxiliary_end == pytest.approx(original.auxiliary_end, abs=1.0)
    assert again.speed_limit == original.speed_limit
    assert sumolib.net.readNet(str(again.net)).hasEdge("exit") == (name == "us101")


@pytest.mark.parametrize(
    "numbers",
    [RampNumbers(lanes=2), RampNumbers(lanes=3, acceleration_lane=250.0), RampNumbers(2, 2, 300.0)],
)
def test_a_ramp_of_numbers_comes_back(tmp_path: Path, numbers: RampNumbers) -> None:
    original = Ramp.load(new_ramp(tmp_path / "first", numbers))
    again = Ramp.load(ramp_from_net(tmp_path / "again", original.net, link="ramp"))
    assert again.changes_lane == original.changes_lane
    assert again.merging_point == original.merging_point
    assert [section.lane for section in again.main + again.ramp] == [
        section.lane for section in original.main + original.ramp
    ]
    if original.changes_lane:
        assert again.auxiliary_end == pytest.approx(original.auxiliary_end, abs=0.1)


def test_a_net_without_types_compressed_and_with_netconverts_speed(tmp_path: Path) -> None:
    packed = tmp_path / "game.net.xml.gz"
    packed.write_bytes(gzip.compress((GAMES / "ramp" / "ramp.net.xml").read_bytes()))
    folder = ramp_from_net(tmp_path / "game", packed)
    assert check(folder) == [], "13.89 m/s, netconvert's default, is 50 km/h, a limit like any other"
    ramp = Ramp.load(folder)
    assert ramp.ramp_route[-4:] == ("gneE14", "gneE7", "gneE8", "gneE11")
    assert 111.0 < ramp.auxiliary_end < 120.0
    # Upstream both paths share a road in the net; the on-ramp begins where it leaves it.
    assert not set(ramp.main_route) & {section.edge for section in ramp.ramp if section.end <= 0.0}


def test_an_on_ramp_from_the_left(tmp_path: Path) -> None:
    original = new_ramp(tmp_path / "first", RampNumbers(lanes=2, acceleration_lane=250.0))
    mirrored = tmp_path / "left.net.xml"
    plain = tmp_path / "left"
    text = (original / "first.con.xml").read_text()
    lane = {"main_in": {0: 1, 1: 0}, "ramp": {0: 0}, "merge": {0: 2, 1: 1, 2: 0}, "main_out": {0: 1, 1: 0}}

    def mirror(found: re.Match[str]) -> str:
        start, one, end, other = found.groups()
        return f'from="{start}" fromLane="{lane[start][int(one)]}" to="{end}" toLane="{lane[end][int(other)]}"'

    connections = re.sub(r'from="(\w+)" fromLane="(\d)" to="(\w+)" toLane="(\d)"', mirror, text)
    Path(f"{plain}.con.xml").write_text(connections)
    for kind in ("nod", "edg"):
        flipped = re.sub(
            r"(-?[\d.]+),(-?[\d.]+)", lambda m: f"{m[1]},{-float(m[2])}", (original / f"first.{kind}.xml").read_text()
        )
        flipped = re.sub(r' y="(-?[\d.]+)"', lambda m: f' y="{-float(m[1])}"', flipped)
        Path(f"{plain}.{kind}.xml").write_text(flipped)
    files = [
        word for kind, flag in (("nod", "-n"), ("edg", "-e"), ("con", "-x")) for word in (flag, f"{plain}.{kind}.xml")
    ]
    netconvert(mirrored, *files, "-o", str(mirrored))
    ramp = Ramp.load(ramp_from_net(tmp_path / "again", mirrored))
    assert [section.lane for section in ramp.main] == [1, 1, 1]
    assert [section.lane for section in ramp.ramp] == [0, 2]
    assert check(tmp_path / "again") == []


@pytest.mark.parametrize(
    ("net", "link", "message"),
    [
        (A10, None, r"2 on-ramps; choose one with --link: 308396220 \(into 264308374, .* 173 m\), 24498409 \("),
        (A10, "nowhere", r"--link: the net has no edge 'nowhere'; 2 on-ramps; choose one"),
        (GAMES / "cross" / "cross.net.xml", None, "no on-ramp found: no edge of type motorway_link"),
        (shipped("sumo_nets") / "designed" / "designed.net.xml", None, "no on-ramp found"),
        (shipped("sumo_nets") / "us101" / "us101.edg.xml", None, "its root is <edges>, not <net>"),
        (Path(__file__), None, "not XML"),
        (Path("missing.net.xml"), None, "missing.net.xml: no such file"),
        (
            GAMES / "fkk_in" / "ingolstadt.net.xml.gz",
            "30399326#1.23",
            "lane -137246371#2_2 goes on beside the road for .*: no car has to merge",
        ),
    ],
)
def test_what_is_no_ramp_is_one_line(tmp_path: Path, net: Path, link: str | None, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        ramp_from_net(tmp_path / "mine", net, link)
    assert "\n" not in str(caught.value)
    assert str(net) in str(caught.value)
    assert not (tmp_path / "mine").exists()


def test_no_grid_of_streets_holds_an_on_ramp(tmp_path: Path) -> None:
    grid = tmp_path / "grid.net.xml"
    subprocess.run([sumolib.checkBinary("netgenerate"), "--grid", "-o", str(grid)], check=True, capture_output=True)
    with pytest.raises(UserError, match="no on-ramp found"):
        ramp_from_net(tmp_path / "mine", grid)


def test_the_speed_limit_can_be_given(tmp_path: Path) -> None:
    folder = ramp_from_net(tmp_path / "bremen", GAMES / "highway" / "highway.net.xml", speed_limit=33.0)
    assert Ramp.load(folder).speed_limit == 33.0
    assert check(folder) == []

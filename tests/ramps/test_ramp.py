import math
from pathlib import Path

import numpy as np
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.ngsim.sites import shipped_sites
from merge_cosim.ramps.ramp import Ramp, ramp_names
from merge_cosim.sumo.lane_map import LaneMap, LanePosition

NAMES = ("designed", "i80", "us101")


def copy_with(folder: Path, old: str, new: str, name: str = "us101") -> Path:
    """A copy of a shipped ramp whose ramp.toml has one passage replaced."""
    for path in (shipped("sumo_nets") / name).iterdir():
        text = path.read_text()
        if path.name == "ramp.toml":
            assert old in text
            text = text.replace(old, new, 1)
        (folder / path.name).write_text(text)
    return folder


def test_shipped_ramps_are_found() -> None:
    assert ramp_names() == sorted(NAMES)


def test_designed_ramp_joins_by_a_connection() -> None:
    ramp = Ramp.load("designed")
    assert not ramp.changes_lane
    assert ramp.auxiliary_end == math.inf
    assert ramp.merging_point == 0.0
    assert ramp.main_route == ("main_in", "main_out")
    assert ramp.ramp_route == ("ramp", "main_out")


def test_us101_has_an_auxiliary_lane() -> None:
    ramp = Ramp.load("us101")
    assert ramp.changes_lane
    assert ramp.auxiliary_end == pytest.approx(213.0)
    assert ramp.ramp_route == ("ramp", "weave", "main_out")


def test_edges_of_awkward_lengths_end_exactly_at_the_gore(tmp_path: Path) -> None:
    folder = copy_with(tmp_path, 'ramp = ["ramp"]', 'ramp = ["ramp0", "ramp1", "ramp"]', "designed")
    file = folder / "ramp.toml"
    file.write_text(file.read_text().replace("merging_lane = [0]", "merging_lane = [0, 0, 0]"))
    net = folder / "designed.net.xml"
    lane = '<lane id="ramp{0}_0" index="0" speed="29" length="{1}" shape="0,0 1,0"/>'
    edge = f'<edge id="ramp{{0}}" from="a{{0}}" to="b{{0}}">{lane}</edge>'
    nodes = '<junction id="{}{}" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape=""/>'
    extra = "".join(edge.format(i, length) for i, length in enumerate((0.1, 0.2)))
    extra += "".join(nodes.format(end, i) for end in "ab" for i in range(2))
    net.write_text(net.read_text().replace("</net>", extra + "</net>"))
    ramp = Ramp.load(folder)
    assert ramp.ramp[-1].end == 0.0
    assert not ramp.changes_lane
    assert ramp.ramp_route == ("ramp0", "ramp1", "ramp", "main_out")
    # The on-ramp reaches further back than the main road: each car needs room on its own path.
    stations = np.array([-400.0, -500.2])
    assert ramp.holds(np.zeros(2), stations, stations[::-1]).tolist() == [True, False]
    assert LaneMap(ramp).place("ramp", 0.0, 0.0) == LanePosition("main_out", 0, 0.0)


def test_unknown_name_lists_the_choices() -> None:
    with pytest.raises(UserError, match="designed, i80, us101"):
        Ramp.load("us102")


def test_folder_works_as_well_as_name() -> None:
    assert Ramp.load(shipped("sumo_nets") / "us101") == Ramp.load("us101")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("merging_point", "mergin_point", r"ramp.toml: mergin_point: unknown key; did you mean 'merging_point'"),
        ("merging_point = 42.0", "merging_point = 'far'", r"ramp.toml: merging_point: .*number"),
        ('gore = "weave"', 'gore = "main_in"', "gore must be an edge of main after the first"),
        ("host_lane = [0, 1, 0]", "host_lane = [0, 1]", "host_lane needs one lane index per edge"),
        ("host_lane = [0, 1, 0]", "host_lane = [0, 6, 0]", "'weave' has no lane 6; its lanes are 0 ... 5"),
        ('ramp = ["ramp", "weave"]', 'ramp = ["onramp", "weave"]', "ramp: the net us101.net.xml has no edge 'onramp'"),
        ('ramp = ["ramp", "weave"]', 'ramp = ["weave", "ramp"]', "must be its last ones and start with gore"),
        ('net = "us101.net.xml"', 'net = "us102.net.xml"', "us102.net.xml: no such net; build it"),
        ("main = [", "main = ", "not valid TOML"),
    ],
)
def test_a_mistake_in_the_file_is_one_clear_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        Ramp.load(copy_with(tmp_path, old, new))
    assert "\n" not in str(caught.value)


def test_gore_is_where_the_trajectories_have_it() -> None:
    for site in shipped_sites():
        mapping = Ramp.load(site.name).ngsim
        assert mapping is not None
        assert mapping.gore_local_y == pytest.approx(site.gore_y, abs=0.01)
        assert {site.host_lane, *site.ramp_lanes} <= set(mapping.lanes)

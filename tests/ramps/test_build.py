from pathlib import Path

import pytest
from test_ramp import NAMES, copy_with

from merge_cosim.errors import UserError
from merge_cosim.files import shipped
from merge_cosim.ramps.build import build
from merge_cosim.ramps.check import check


@pytest.mark.parametrize("name", NAMES)
def test_shipped_nets_are_what_their_sources_build(tmp_path: Path, name: str) -> None:
    folder = copy_with(tmp_path, "title", "title", name)
    committed = (folder / f"{name}.net.xml").read_bytes()
    assert build(folder).read_bytes() == committed
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        p.name for p in (shipped("sumo_nets") / name).iterdir()
    )


@pytest.mark.parametrize("name", NAMES)
def test_shipped_ramps_have_no_problem(name: str) -> None:
    assert check(shipped("sumo_nets") / name) == []


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('main = ["main_in",', 'main = ["entry",', "main: the net us101.net.xml has no edge 'entry'"),
        ('ramp = ["ramp", "weave"]', 'ramp = ["exit", "weave"]', "no connection in the net from exit_0 to weave_0"),
        ("merging_lane = [0, 0]", "merging_lane = [0, 3]", "lane 3 of 'weave' is not beside the host's lane 1"),
        ("speed_limit = 29.0", "speed_limit = 40.0", "lane weave_1 allows 29 m/s, less than 40 m/s"),
        ("weave = 213.0", "weave = 355.0", "lengths.weave: built 213.00 m long, intended 355.00 m"),
        ("weave = 213.0\n", "", "lengths.weave: missing"),
        ("merging_point = 42.0", "merging_point = 180.0", "33 m of auxiliary lane after it, but 53 m to brake in"),
        ('"weave_0"', '"weave_9"', "ngsim.lanes.6: the net us101.net.xml has no lane 'weave_9'"),
        ("speed_limit = 29.0", "", "speed_limit: missing; every ramp needs it"),
        ('["main_in", "weave", "main_out"]', '["weave", "main_in", "main_out"]', "gore must be an edge of main after"),
        ("title", "titel", "titel: unknown key; did you mean 'title'?"),
        ('"us101.net.xml"', '"other.net.xml"', "other.net.xml: no such net"),
    ],
)
def test_each_problem_is_one_line(tmp_path: Path, old: str, new: str, problem: str) -> None:
    problems = check(copy_with(tmp_path, old, new))
    assert any(problem in line for line in problems), problems
    assert not any("\n" in line for line in problems)


def test_swallowed_lane_is_found(tmp_path: Path) -> None:
    folder = copy_with(tmp_path, "title", "title", "designed")
    nodes = folder / "designed.nod.xml"
    shape = ' radius="1" shape="-1.00,-1.80 -1.00,1.80 1.00,1.80 1.00,-1.80"'
    assert shape in nodes.read_text()
    nodes.write_text(nodes.read_text().replace(shape, ""))
    build(folder)
    assert any("lengths.main_in: drawn" in line for line in check(folder))


def test_what_netconvert_refuses_is_one_line(tmp_path: Path) -> None:
    folder = copy_with(tmp_path, "title", "title", "designed")
    (folder / "designed.edg.xml").write_text("<edges><edge id='main_in' from='nowhere' to='gore'/></edges>")
    with pytest.raises(UserError, match=r"designed.netccfg: netconvert refuses it: .*nowhere") as caught:
        build(folder)
    assert "\n" not in str(caught.value)
    (folder / "designed.netccfg").unlink()
    with pytest.raises(UserError, match="0 files"):
        build(folder)

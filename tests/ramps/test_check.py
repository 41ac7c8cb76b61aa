"""What `ramp check` tells: each problem is one line that names file, key and remedy."""

import shutil
from pathlib import Path

import pytest
from test_ramp import NAMES, copy_with

from merge_cosim.core.files import shipped
from merge_cosim.ramps.build import build
from merge_cosim.ramps.check import check, notes
from merge_cosim.ramps.create.new import RampNumbers, new_ramp

ON = '<connection from="merge" fromLane="1" to="main_out" toLane="0"/>'
UP = '<connection from="merge" fromLane="1" to="main_out" toLane="1"/>'


@pytest.fixture(scope="module")
def with_lane(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ramp with an acceleration lane."""
    return new_ramp(tmp_path_factory.mktemp("made") / "mine", RampNumbers(lanes=2, acceleration_lane=250.0))


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
        ("host_lane = [0, 1, 0]", "host_lane = [0, -1, 0]", "main: edge 'weave' has no lane -1; its lanes are 0 ... 5"),
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


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize(
    ("kind", "old", "new", "problem"),
    [
        (
            "con",
            'from="ramp" fromLane="0" to="merge" toLane="0"',
            'from="ramp" fromLane="0" to="merge" toLane="1"',
            "merging_lane: no connection in the net from ramp_0 to merge_0 (it leads to merge_1); add <connection",
        ),
        ("con", ON, "", "host_lane: no connection in the net from merge_1 to main_out_0 (it leads to nothing)"),
        ("con", ON, UP, "host_lane: no connection in the net from merge_1 to main_out_0 (it leads to main_out_1)"),
        ("edg", 'id="merge"', 'disallow="passenger" id="merge"', "merge_0 is closed to passenger cars; mend 'allow'"),
        ("edg", 'width="3.60"', 'width="7.20"', "lane main_in_0 is 7.20 m wide, not 2.5 to 6 m"),
        (
            "nod",
            'id="lane_end" x="250.00" y="0.00" type="unregulated"',
            'id="lane_end" x="250.00" y="0.00" type="traffic_light"',
            "main/ramp: node 'lane_end' has a traffic light",
        ),
    ],
)
def test_each_problem_of_the_sources_is_reported(
    with_lane: Path, tmp_path: Path, kind: str, old: str, new: str, problem: str
) -> None:
    folder = shutil.copytree(with_lane, tmp_path / "mine")
    change(folder / f"mine.{kind}.xml", old, new)
    assert check(folder) == [
        f"{folder / 'mine.net.xml'}: not what its plain XML builds now; build it with: merge-cosim ramp build {folder}"
    ]
    build(folder)
    problems = check(folder)
    assert any(problem in line for line in problems), problems
    assert all(line.startswith(str(folder)) and "\n" not in line for line in problems)


def test_a_road_that_turns_back_is_reported(tmp_path: Path) -> None:
    folder = new_ramp(tmp_path / "mine", RampNumbers())
    change(folder / "mine.edg.xml", 'shape="0.00,0.00 1500.00,0.00"', 'shape="0.00,0.00 -9.00,40.00 1500.00,0.00"')
    build(folder)
    expected = "main: stations would run backwards: 'main_out' turns back at the end of 'main_in'"
    assert any(expected in line for line in check(folder))


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("main_before = -206.0", "main_before = 206.0", "extensions.main_before: 206 m past the gore, but it must be"),
        ("merging_point = 42.0", "merging_point = 250.0", "merging_point: 37 m beyond the auxiliary lane's end, 213 m"),
        (
            'ramp = ["ramp", "weave"]\nmerging_lane = [0, 0]',
            'ramp = ["ramp", "weave", "main_out"]\nmerging_lane = [0, 0, 1]',
            "ramp: the auxiliary lane goes on to the road's end: no car has to merge",
        ),
        (
            'ramp = ["ramp", "weave"]',
            'ramp = ["exit", "weave"]',
            "ramp: stations would jump: 'exit' ends at node 'exit_end', but 'weave' begins at 'gore'",
        ),
    ],
)
def test_each_problem_of_the_definition_is_reported(tmp_path: Path, old: str, new: str, problem: str) -> None:
    problems = check(copy_with(tmp_path, old, new))
    assert any(problem in line for line in problems), problems


def test_a_merging_point_beyond_a_gore_without_a_lane_is_reported(tmp_path: Path) -> None:
    (problem,) = check(copy_with(tmp_path, "merging_point = 0.0", "merging_point = 20.0", "designed"))
    assert "merging_point: there is no auxiliary lane, so it must be 0.0" in problem


def test_an_auxiliary_lane_whose_rest_is_not_listed_is_reported(with_lane: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(with_lane, tmp_path / "mine")
    change(folder / "ramp.toml", "host_lane = [0, 1, 0]", "host_lane = [0, 1, 1]")
    change(folder / "mine.con.xml", '<connection from="merge" fromLane="2" to="main_out" toLane="1"/>', UP)
    change(folder / "mine.con.xml", ON, ON.replace('fromLane="1"', 'fromLane="0"'))
    build(folder)
    assert check(folder) == [
        f"{folder / 'ramp.toml'}: ramp: the auxiliary lane goes on as main_out_0: list 'main_out' in ramp and its lane "
        "in merging_lane"
    ]


def test_notes_are_no_problems(tmp_path: Path) -> None:
    folder = new_ramp(tmp_path / "mine", RampNumbers(acceleration_lane=100.0))
    assert check(folder) == []
    found = notes(folder)
    assert any("80 m of auxiliary lane after it; braking comfortably (3.4 m/s^2)" in line for line in found)
    assert any("no georeference" in line for line in found)
    (folder / "mine.netccfg").unlink()
    assert check(folder) == []
    assert any("neither edited nor rebuilt" in line for line in notes(folder))
    assert notes(shipped("sumo_nets") / "us101") == []

"""Cases as CommonRoad scenarios, read back by CommonRoad's own library and compared with the run."""

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sumolib
from command import merge_cosim, refused

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.export.commonroad import need_library
from merge_cosim.ramps.export.lanelets import lanelets
from merge_cosim.ramps.export.poses import SIDEWAYS, poses
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.lane_map import LaneMap, LanePosition

pytest.importorskip("commonroad")

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter
from commonroad.common.util import FileFormat
from commonroad.scenario.lanelet import LaneletType
from commonroad.scenario.state import CustomState
from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry
from commonroad.scenario.traffic_sign_interpreter import TrafficSignInterpreter

ROUNDING = 1e-3
"""Files have four decimals."""
GAP = 1.2
"""Metres by which SUMO's positions may differ: its lanes end at junctions, and a bumper in a bend is off the middle."""
CASES = {
    "us101": ("us101-replay", "--source", "surrogate", "--case", "surrogate_1-112.1-h106.1", "--method", "pgm"),
    "i80": ("designed-2", "--set", "ramp=i80", "--case", "d+1_h15_m14", "--method", "acc"),
    "designed": ("designed-2", "--case", "d+1_h15_m14", "--method", "acc"),
}
MODEL = ("--model", "us101-ngsim")  # the surrogate's own has seen some of the few cars that the tests have


class Exported:
    """A case: its files, its trace, and the scenario read back."""

    def __init__(self, folder, ramp):
        self.ramp, self.arguments, self.folder = Ramp.load(ramp), (*CASES[ramp], *MODEL), folder
        done = merge_cosim("export", *self.arguments, "--out", "cr", "--commonroad", "--json", cwd=folder)
        assert done.returncode == 0, done.stderr
        self.file = folder / json.loads(done.stdout)["commonroad"]
        done = merge_cosim("run", *self.arguments, "--trace", "trace.csv", "--fcd", "fcd.xml", "--json", cwd=folder)
        self.row = json.loads(done.stdout)
        with (folder / "trace.csv").open(newline="") as file:
            self.trace = [
                {name: float(value) for name, value in row.items() if name != "case"} for row in csv.DictReader(file)
            ]
        self.scenario, problems = CommonRoadFileReader(str(self.file)).open()
        (self.problem,) = problems.planning_problem_dict.values()
        (self.car,) = self.scenario.dynamic_obstacles
        self.states = [self.car.initial_state, *self.car.prediction.trajectory.state_list]
        self.network = self.scenario.lanelet_network
        self.fcd = list(sumolib.xml.parse(str(folder / "fcd.xml"), "timestep"))
        self.merge_position = self.found_merge_position()

    def found_merge_position(self):
        """The merging point [m past the gore]: the host's place in SUMO's own file less its station in the trace."""
        row = self.trace[1]
        (step,) = [step for step in self.fcd if float(step.time) == row["time_s"]]
        (host,) = [car for car in step.vehicle if car.id == "t0.host"]
        edge, _, lane = host.lane.removeprefix("t0.").rpartition("_")
        return LaneMap(self.ramp).station(LanePosition(edge, int(lane), float(host.pos)), 0.0) - row["host_station_m"]


@pytest.fixture(scope="module", params=CASES)
def exported(request, tmp_path_factory):
    return Exported(tmp_path_factory.mktemp(request.param), request.param)


def test_the_file_is_valid_and_named_by_its_benchmark_id(exported):
    assert CommonRoadFileWriter.check_validity_of_commonroad_file(exported.file.read_bytes(), FileFormat.XML)
    number = {"us101": "USA_US101", "i80": "USA_I80", "designed": "ZAM_DESIGNED"}[exported.ramp.name]
    assert re.fullmatch(rf"{number}Merge-1_\d+_T-1", exported.file.stem)
    assert str(exported.scenario.scenario_id) == exported.file.stem
    assert exported.scenario.dt == 0.1
    again = merge_cosim("export", *exported.arguments, "--out", "again", "--commonroad", cwd=exported.folder)
    assert (exported.folder / again.stdout.strip()).read_bytes() == exported.file.read_bytes()


def test_the_lanelets_fit_together(exported):
    network = exported.network
    for lanelet in network.lanelets:
        assert lanelet.polygon.shapely_object.is_valid
        for after in map(network.find_lanelet_by_id, lanelet.successor):
            assert lanelet.lanelet_id in after.predecessor
            assert np.array_equal(lanelet.left_vertices[-1], after.left_vertices[0])
            assert np.array_equal(lanelet.right_vertices[-1], after.right_vertices[0])
        if lanelet.adj_left is not None:
            neighbour = network.find_lanelet_by_id(lanelet.adj_left)
            assert (neighbour.adj_right, neighbour.adj_right_same_direction) == (lanelet.lanelet_id, True)
            assert np.array_equal(lanelet.left_vertices, neighbour.right_vertices)
    interpreter = TrafficSignInterpreter(SupportedTrafficSignCountry(exported.scenario.scenario_id.country_id), network)
    every = frozenset(lanelet.lanelet_id for lanelet in network.lanelets)
    assert all(interpreter.speed_limit(frozenset({number})) == exported.ramp.speed_limit for number in every)


def test_lanelets_have_the_type_of_their_road(exported):
    kinds = {}
    for name, lanelet in zip(lanelets(exported.ramp), exported.network.lanelets, strict=True):
        kinds.setdefault(next(iter(lanelet.lanelet_type)), set()).add(name)
    assert kinds[LaneletType.ACCESS_RAMP] == {f"{part.edge}_{part.lane}" for part in exported.ramp.ramp}
    assert kinds.get(LaneletType.EXIT_RAMP, set()) == ({"exit_0"} if exported.ramp.name == "us101" else set())


def test_the_merging_car_is_where_the_run_had_it(exported):
    states, trace = exported.states, exported.trace
    assert [state.time_step for state in states] == list(range(len(trace)))
    assert [state.velocity for state in states] == pytest.approx([r["merging_speed_m_s"] for r in trace], abs=ROUNDING)
    stations = np.array([row["merging_station_m"] for row in trace])
    length = exported.car.obstacle_shape.length
    road, at = lanelets(exported.ramp), exported.merge_position
    places, headings = poses(road, exported.ramp, "ramp", stations, length, at)
    written = np.array([state.position for state in states])
    assert written == pytest.approx(places, abs=ROUNDING)
    assert [state.orientation for state in states] == pytest.approx(headings, abs=ROUNDING)
    assert all(exported.network.find_lanelet_by_position(list(written)))
    assert np.hypot(*np.diff(written, axis=0).T).sum() == pytest.approx(np.ptp(stations), rel=0.01)


def test_sumo_has_the_car_in_the_same_place(exported):
    length, seen = exported.car.obstacle_shape.length, 0
    states = {round(row["time_s"], 6): (row, state) for row, state in zip(exported.trace, exported.states, strict=True)}
    for step in exported.fcd:
        if (time := round(float(step.time), 6)) not in states:
            continue
        row, state = states[time]
        (car,) = [car for car in step.vehicle if car.id == "t0.merging"]
        if abs(row["merging_station_m"]) > SIDEWAYS or not exported.ramp.changes_lane:
            front = state.position + 0.5 * length * np.array([np.cos(state.orientation), np.sin(state.orientation)])
            assert np.hypot(*(front - [float(car.x), float(car.y)])) < GAP
            seen += 1
    assert seen > 20


def test_the_host_starts_short_of_the_goal_and_ends_in_it(exported):
    start, first, last = exported.problem.initial_state, exported.trace[0], exported.trace[-1]
    assert start.velocity == pytest.approx(first["host_speed_m_s"], abs=ROUNDING)
    assert start.acceleration == 0.0
    road, at = lanelets(exported.ramp), exported.merge_position
    length = 5.0  # of no account: the goal is reached metres before the record ends
    stations = np.array([first["host_station_m"], last["host_station_m"]])
    places, _ = poses(road, exported.ramp, "main", stations, length, at)
    assert np.hypot(*(start.position - places[0])) < length
    assert last["host_station_m"] > length
    end = CustomState(time_step=len(exported.trace) - 1, position=places[1])
    assert exported.problem.goal.is_reached(end)
    assert not exported.problem.goal.is_reached(CustomState(time_step=0, position=start.position))


def test_the_place_on_earth_is_the_nets(exported):
    location = exported.network.location.geo_transformation
    if exported.ramp.name == "designed":
        assert location is None
        return
    (net,) = sumolib.xml.parse(str(exported.ramp.net), "location")
    assert location.geo_reference == net.projParameter
    offset = [float(number) for number in net.netOffset.split(",")]
    assert [-location.x_translation, -location.y_translation] == offset


@pytest.mark.parametrize("exported", ["us101"], indirect=True)  # the example reads the file of US-101
def test_the_pages_example_runs(exported):
    page = (Path(__file__).parents[2] / "docs/sumo-tools.md").read_text().replace(" \\\n    ", " ")
    assert f"merge-cosim export {' '.join(CASES['us101'])} --out cr --commonroad" in page
    assert " ".join(CASES["designed"]) in page
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", example], cwd=exported.folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (exported.folder / "cr/us101.png").read_bytes().startswith(b"\x89PNG")


def test_the_logged_host_can_be_met(tmp_path):
    case = CASES["us101"][:-1]
    done = merge_cosim("export", *case, "human", "--out", ".", "--commonroad", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "host driven by human" in (tmp_path / done.stdout.strip()).read_text()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("traffic-light", "--case", "000", "--commonroad"), "--commonroad writes encounters of two cars, not scenes"),
        (("designed-2", "--case", "d+1_h15_m14", "--method", "acc"), "--method: only with --commonroad"),
        (("designed-2", "--case", "none", "--commonroad"), "no case 'none'"),
    ],
)
def test_mistakes_get_one_line_and_status_2(tmp_path, arguments, expected):
    assert expected in refused("export", *arguments, "--out", "cr", cwd=tmp_path)
    assert not (tmp_path / "cr").exists()


def test_without_the_library_one_line_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "commonroad", None)  # as Python remembers a module that cannot be imported
    with pytest.raises(UserError, match=r"pip install 'merge-cosim\[commonroad\]'"):
        need_library()

"""SUMO's own files about a single run, against our record of it."""

import csv
import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import sumo
import sumolib
from command import merge_cosim, refused, run_process
from lxml import etree

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.lane_map import LaneMap, LanePosition
from merge_cosim.sumo.outputs import SumoOutputs
from merge_cosim.sweeps.plan import SweepRequest, plan

OUTPUTS = ("fcd", "ssm", "lanechange", "tripinfo", "collisions")
ROUNDING = 2e-6
"""Both files have six decimals."""


def run_with_outputs(folder, *arguments):
    """Run a case with all outputs in `sumo/` and return its row and its trace by time."""
    files = [word for name in OUTPUTS for word in (f"--{name}", f"sumo/{name}.xml")]
    done = merge_cosim("run", *arguments, "--trace", "trace.csv", *files, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    with (folder / "trace.csv").open(newline="") as file:
        trace = {float(row["time_s"]): row for row in csv.DictReader(file)}
    return json.loads(done.stdout), trace


def check_fcd(folder, ramp, merge_position, trace):
    """Every cycle of the trace after the first must be in the floating car data, with the same stations and speeds."""
    times = []
    for step in sumolib.xml.parse(str(folder / "sumo/fcd.xml"), "timestep"):
        times.append(float(step.time))
        assert {car.id for car in step.vehicle} == {"t0.host", "t0.merging"}
        for car in step.vehicle:
            if times[-1] not in trace:
                continue
            row, name = trace[times[-1]], car.id.removeprefix("t0.")
            edge, _, lane = car.lane.removeprefix("t0.").rpartition("_")
            station = LaneMap(ramp).station(LanePosition(edge, int(lane), float(car.pos)), merge_position)
            assert station == pytest.approx(float(row[f"{name}_station_m"]), abs=ROUNDING)
            # ours is the way over the time: six decimals of a position are five of a speed
            assert float(car.speed) == pytest.approx(float(row[f"{name}_speed_m_s"]), abs=2e-5)
    assert set(times) > set(trace) - {0.0}
    assert min(times) == 0.1
    assert len(times) == len(trace)  # the end of the last cycle in place of the start


@pytest.fixture(scope="module")
def us101(tmp_path_factory):
    """The first case of the surrogate of US-101 under ACC: its folder, encounter, row and trace."""
    folder = tmp_path_factory.mktemp("us101")
    cases = plan(SweepRequest(["us101-replay"], ["acc"], source="surrogate"))[0].cases.encounters
    arguments = ("us101-replay", "--source", "surrogate", "--case", cases.case[0], "--method", "acc")
    return folder, cases, *run_with_outputs(folder, *arguments)


def test_fcd_is_the_trace_on_us101(us101):
    folder, cases, _, trace = us101
    check_fcd(folder, Ramp.load("us101"), float(cases.merge_position[0]), trace)


def test_the_merging_car_is_the_one_that_changes_lane(us101):
    folder, cases, row, _ = us101
    (change,) = sumolib.xml.parse(str(folder / "sumo/lanechange.xml"), "change")
    assert (change.id, change.attr_from, change.to) == ("t0.merging", "t0.weave_0", "t0.weave_1")
    since = float(change.time) - row["merging_reached_s"]  # it changes in the cycle in which it arrives
    assert -1e-9 <= since < 0.1
    assert float(change.pos) == pytest.approx(cases.merge_position[0] + since * float(change.speed), abs=0.01)


def test_sumos_gaps_are_ours(us101):
    folder, cases, row, trace = us101
    seen = 0
    for entry in sumolib.xml.parse(str(folder / "sumo/ssm.xml"), "globalMeasures"):
        if entry.ego != "t0.merging":
            continue
        for time, gap in zip(entry.timeSpan[0].values.split(), entry.SGAPSpan[0].values.split(), strict=True):
            if gap != "NA" and (cycle := trace.get(float(time))):
                ours = float(cycle["host_station_m"]) - cases.host_length[0] - float(cycle["merging_station_m"])
                assert float(gap) == pytest.approx(ours, abs=ROUNDING)
                seen += 1
    assert row["host_first"]
    assert seen > 10


def test_trips_have_both_cars_and_contacts_are_as_in_the_row(us101):
    folder, _, row, _ = us101
    trips = list(sumolib.xml.parse(str(folder / "sumo/tripinfo.xml"), "tripinfo"))
    assert [trip.id for trip in trips] == ["t0.host", "t0.merging"]
    contacts = list(sumolib.xml.parse(str(folder / "sumo/collisions.xml"), "collision"))
    assert bool(contacts) == row["sumo_collision"]


def test_fcd_is_the_trace_on_the_designed_ramp_and_sumos_tool_draws_it(tmp_path):
    row, trace = run_with_outputs(tmp_path, "designed-2", "--case", "d+1_h15_m14", "--method", "acc")
    check_fcd(tmp_path, Ramp.load("designed"), 0.0, trace)
    plain = merge_cosim("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc", "--json", cwd=tmp_path)
    assert json.loads(plain.stdout) == row
    tool = Path(sumo.SUMO_HOME) / "tools/plot_trajectories.py"
    command = [sys.executable, tool, "sumo/fcd.xml", "-t", "td", "-o", "td.png", "--blind", "--csv-output", "td.txt"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "td.png").read_bytes().startswith(b"\x89PNG")
    assert "t0.merging" in (tmp_path / "td.txt").read_text()


SCENE = """
title = "A minute of traffic"
ramp = "us101"

[encounters]
kind = "traffic"
replications = 1

[encounters.demand]
duration = 60
warm_up = 10
through = 3000
merging = 600
hosts = 360

[merging]
model = "sumo"
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A short scene with all outputs: its folder, facts, and the meetings' record."""
    folder = tmp_path_factory.mktemp("scene")
    (folder / "short.toml").write_text(SCENE)
    files = [word for name in OUTPUTS for word in (f"--{name}", f"scene/{name}.xml")]
    arguments = ("short.toml", "--case", "000", "--method", "pgm", "--trace", "trace.csv", *files, "--json")
    done = merge_cosim("run", *arguments, cwd=folder)
    assert done.returncode == 0, done.stderr
    with (folder / "trace.csv").open(newline="") as file:
        return folder, json.loads(done.stdout), list(csv.DictReader(file))


def test_fcd_of_a_scene_has_all_cars_and_the_record_of_its_meetings(scene):
    folder, facts, record = scene
    ramp, seen, cars = Ramp.load("us101"), {}, set()
    lanes = LaneMap(ramp)
    for step in etree.parse(folder / "scene/fcd.xml").iter("timestep"):
        for car in step:
            cars.add(name := car.get("id"))
            if name.startswith(("host", "merging")):
                edge, _, lane = car.get("lane").rpartition("_")
                place = lanes.station(LanePosition(edge, int(lane), float(car.get("pos"))), 0.0)
                seen[float(step.get("time")), name] = (place, float(car.get("speed")))
    assert len(cars) == facts["vehicles"]
    assert len(record) > 50
    for row in record:
        _, *names = row["case"].split("/")
        for role, name in zip(("host", "merging"), names, strict=True):
            recorded = (float(row[f"{role}_x_m"]), float(row[f"{role}_speed_m_s"]))
            assert seen[float(row["time_s"]), name] == pytest.approx(recorded, abs=ROUNDING)


def test_other_outputs_of_a_scene_agree_with_its_facts(scene):
    folder, facts, _ = scene
    trips = list(sumolib.xml.parse(str(folder / "scene/tripinfo.xml"), "tripinfo"))
    assert len(trips) == facts["vehicles"]
    arrived = [float(trip.timeLoss) for trip in trips if float(trip.arrival) >= 0.0]
    assert sum(arrived) / len(arrived) == pytest.approx(facts["time_loss_s"], abs=0.01)
    changes = list(sumolib.xml.parse(str(folder / "scene/lanechange.xml"), "change"))
    merged = {change.id for change in changes if (change.attr_from, change.to) == ("weave_0", "weave_1")}
    assert any(name.startswith("merging") for name in merged)
    contacts = list(sumolib.xml.parse(str(folder / "scene/collisions.xml"), "collision"))
    assert len(contacts) == facts["host_contacts"] + facts["other_contacts"]
    egos = {entry.ego for entry in sumolib.xml.parse(str(folder / "scene/ssm.xml"), "globalMeasures")}
    assert egos >= {trip.id for trip in trips if trip.id.startswith("host") and float(trip.arrival) >= 0.0}


def test_sumos_tools_draw_a_scene(scene):
    """The commands of docs/sumo-tools.md, on the cars of the scene's first meeting."""
    folder, _, record = scene
    page = (Path(__file__).parents[2] / "docs/sumo-tools.md").read_text().replace("\\\n", " ")
    commands = [
        shlex.split(line) for line in page.splitlines() if line.startswith("python $TOOLS") and " scene/" in line
    ]
    assert len(commands) == 5
    pair = ",".join(record[0]["case"].split("/")[1:])
    environment = os.environ | {"SUMO_HOME": sumo.SUMO_HOME}
    for _, tool, *words in commands:
        script = tool.replace("$TOOLS", f"{sumo.SUMO_HOME}/tools")
        words = [pair if word == "host.2,merging.8" else word for word in words]
        command = [sys.executable, script, *words]
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        if "-o" in words:
            assert (folder / words[words.index("-o") + 1]).read_bytes().startswith(b"\x89PNG")
    assert (folder / "scene/lanechange.csv").stat().st_size > 0


def test_contacts_are_reported(tmp_path, data_dir):
    """A logged pair that docs/collisions.md describes: a contact at the lane change, before scoring begins."""
    case = ("--data", data_dir, "--case", "episode-41-0.1-h3.1", "--method", "acc")
    row, _ = run_with_outputs(tmp_path, "us101-replay", *case)
    contacts = list(sumolib.xml.parse(str(tmp_path / "sumo/collisions.xml"), "collision"))
    assert row["sumo_collision"]
    assert {(contact.collider, contact.victim) for contact in contacts} == {("t0.host", "t0.merging")}


@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="needs xvfb-run")
def test_a_window_writes_the_same(tmp_path):
    case = [sys.executable, "-m", "merge_cosim", "run", "designed-2", "--case", "d+1_h15_m14"]
    case += ["--method", "acc", "--fcd"]
    with_window = ["xvfb-run", "-a", *case, "gui.xml", "--gui", "--delay", "5", "--quit-on-end"]
    for command in ([*case, "plain.xml"], with_window):
        subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=120, check=True)
    plain, gui = ((tmp_path / f"{name}.xml").read_text().partition("<fcd-export")[2] for name in ("plain", "gui"))
    assert plain == gui  # after the header, which holds the options
    assert '<delay value="50.0"/>' in (tmp_path / "gui.xml").read_text()  # SUMO's is per simulated second


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--fcd", "file/x.xml"), "file: cannot be"),
        (("--ssm", "folder"), "folder: cannot be"),
        (("--fcd", "/dev/full"), "/dev/full: is no ordinary file"),
        (("--fcd", "a.xml", "--ssm", "./a.xml"), "a.xml: two of SUMO's outputs"),
        (("--tripinfo", "a:b.xml"), "a:b.xml: SUMO takes a name with a colon"),
    ],
)
def test_mistakes_get_one_line_and_status_2(tmp_path, arguments, expected):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    case = ("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc")
    assert expected in refused(*case, *arguments, cwd=tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file", "folder"]


def test_the_logged_host_is_not_driven_in_sumo(tmp_path):
    case = plan(SweepRequest(["us101-replay"], ["acc"], source="surrogate"))[0].cases.encounters.case[0]
    arguments = ("--source", "surrogate", "--case", case, "--method", "human", "--fcd", "x.xml")
    line = refused("run", "us101-replay", *arguments, cwd=tmp_path)
    assert line.startswith("merge-cosim: SUMO's outputs: the method 'human' is the log itself")
    assert not (tmp_path / "x.xml").exists()


def test_an_output_that_sumo_could_not_write_to_its_end(tmp_path):
    file = tmp_path / "fcd.xml"
    for whole in ("<fcd-export>\n</fcd-export>\n", '<?xml version="1.0"?>\n<collisions/>'):
        file.write_text(whole)
        SumoOutputs(fcd=file).check()
    for cut in ("", '<fcd-export>\n <timestep time="0.1">\n  <vehicle id="t0.ho'):
        file.write_text(cut)
        with pytest.raises(UserError, match=r"fcd\.xml: SUMO could not write it to its end; is the disk full\?"):
            SumoOutputs(fcd=file).check()


def test_a_variable_that_turns_traci_into_libsumo_changes_nothing(tmp_path):
    words = ("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc", "--json")
    done = run_process(*words, cwd=tmp_path, LIBSUMO_AS_TRACI="1")
    assert json.loads(done.stdout)["case"] == "d+1_h15_m14", done.stderr

"""SUMO's own files about a single run, against our record of it."""

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import sumo
import sumolib
from command import merge_cosim

from merge_cosim.experiments.plan import SweepRequest, plan
from merge_cosim.ramps.ramp import Ramp

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
            station = ramp.station(edge, int(lane), float(car.pos), merge_position)
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
    cases = plan(SweepRequest(["us101-replay"], ["acc"], source="surrogate"))[0].encounters
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


def test_contacts_are_reported(tmp_path, data_dir):
    """A logged pair that docs/collisions.md describes: a contact at the lane change, before scoring begins."""
    case = ("--data", data_dir, "--case", "episode-41-0.1-h3.1", "--method", "acc")
    row, _ = run_with_outputs(tmp_path, "us101-replay", *case)
    contacts = list(sumolib.xml.parse(str(tmp_path / "sumo/collisions.xml"), "collision"))
    assert row["sumo_collision"]
    assert {(contact.collider, contact.victim) for contact in contacts} == {("t0.host", "t0.merging")}


@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="needs xvfb-run")
def test_a_window_writes_the_same(tmp_path):
    case = [sys.executable, "-m", "merge_cosim.cli.main", "run", "designed-2", "--case", "d+1_h15_m14"]
    case += ["--method", "acc", "--fcd"]
    with_window = ["xvfb-run", "-a", *case, "gui.xml", "--gui", "--delay", "0"]
    for command in ([*case, "plain.xml"], with_window):
        subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=120, check=True)
    plain, gui = ((tmp_path / f"{name}.xml").read_text().partition("<fcd-export")[2] for name in ("plain", "gui"))
    assert plain == gui  # after the header, which holds the options


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--fcd", "file/x.xml"), "file: cannot be"),
        (("--ssm", "folder"), "folder: cannot be"),
        (("--fcd", "a.xml", "--ssm", "./a.xml"), "a.xml: two of SUMO's outputs"),
        (("--tripinfo", "a:b.xml"), "a:b.xml: SUMO takes a name with a colon"),
    ],
)
def test_mistakes_get_one_line_and_status_2(tmp_path, arguments, expected):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    done = merge_cosim("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file", "folder"]


def test_the_logged_host_is_not_driven_in_sumo(tmp_path):
    case = plan(SweepRequest(["us101-replay"], ["acc"], source="surrogate"))[0].encounters.case[0]
    arguments = ("--source", "surrogate", "--case", case, "--method", "human", "--fcd", "x.xml")
    done = merge_cosim("run", "us101-replay", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("merge-cosim: SUMO's outputs: the method 'human' is the log itself")
    assert not (tmp_path / "x.xml").exists()

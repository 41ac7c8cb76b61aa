"""A case in a SUMO that runs already."""

import json
import socket

import pytest
import sumolib
from command import merge_cosim, refused
from running import Running

from merge_cosim.sumo import attach as attached
from merge_cosim.sweeps.plan import SweepRequest, plan

TRAFFIC = """<routes>
<vehicle id="other" depart="0" departLane="best" departPos="300" departSpeed="max">
<route edges="main_in weave main_out"/></vehicle>
</routes>
"""


def row_of(done):
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_outcome_is_that_of_our_own_sumo(tmp_path):
    case = ("run", "designed-2", "--case", "d-3_h15_m15", "--method", "always-go", "--json")
    with Running("designed") as address:
        attached = row_of(merge_cosim(*case, "--attach", address, "--trace", "attached.csv", cwd=tmp_path))
    assert attached == row_of(merge_cosim(*case, "--trace", "own.csv", cwd=tmp_path))
    assert attached["failed"]
    assert (tmp_path / "attached.csv").read_bytes() == (tmp_path / "own.csv").read_bytes()


@pytest.mark.slow
def test_it_is_the_same_beside_other_traffic_and_in_an_auxiliary_lane(tmp_path):
    name = plan(SweepRequest(["us101-replay"], ["acc"], source="surrogate"))[0].case(0)
    case = ("run", "us101-replay", "--source", "surrogate", "--case", name, "--method", "acc", "--json")
    (tmp_path / "other.rou.xml").write_text(TRAFFIC)
    with Running("us101", "-r", tmp_path / "other.rou.xml", "--fcd-output", tmp_path / "fcd.xml") as address:
        attached = row_of(merge_cosim(*case, "--attach", address, cwd=tmp_path))
    assert attached == row_of(merge_cosim(*case, cwd=tmp_path))
    seen = {car.id for step in sumolib.xml.parse(str(tmp_path / "fcd.xml"), "timestep") for car in step.vehicle or ()}
    assert seen == {"host", "merging", "other"}


@pytest.mark.parametrize(
    ("ramp", "conditions", "expected"),
    [
        ("designed", {"step-length": "1", "collision.action": "teleport"}, "--step-length 0.1 --collision.action warn"),
        ("designed", {"no-internal-links": "false"}, "must be started with --no-internal-links true"),
        ("us101", {}, "SUMO has another net: no lane main_out_0 of"),
    ],
)
def test_another_simulation_is_refused_in_one_line(tmp_path, ramp, conditions, expected):
    with Running(ramp, **conditions) as address:
        arguments = ("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc", "--attach", address)
        done = merge_cosim(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert expected in line


def test_a_car_of_the_same_name_is_refused(tmp_path):
    text = TRAFFIC.replace("other", "host").replace("main_in weave main_out", "main_in main_out")
    (tmp_path / "host.rou.xml").write_text(text)
    with Running("designed", "-r", tmp_path / "host.rou.xml") as address:
        arguments = ("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc", "--attach", address)
        done = merge_cosim(*arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert "the cars cannot be added: " in line


def test_nobody_listening_is_said_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(attached, "TRIES", 2)
    with socket.socket() as taken:  # bound, but not listening
        taken.bind(("localhost", 0))
        address = f"localhost:{taken.getsockname()[1]}"
        arguments = ("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc", "--attach", address)
        line = refused(*arguments, cwd=tmp_path)
    assert f"--attach {address}: no SUMO listens there" in line


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--attach", "8813"), "--attach 8813: not HOST:PORT"),
        (("--attach", "localhost:99999"), "not HOST:PORT"),
        (("--attach", "localhost:8813", "--gui"), "--gui: not with --attach"),
        (("--attach", "localhost:8813", "--fcd", "x.xml"), "SUMO's outputs: not with --attach"),
    ],
)
def test_mistakes_get_one_line_and_status_2(tmp_path, arguments, expected):
    case = ("run", "designed-2", "--case", "d+1_h15_m14", "--method", "acc")
    assert expected in refused(*case, *arguments, cwd=tmp_path)
    assert not any(tmp_path.iterdir())

"""Living traffic through the real command line."""

import csv
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import libsumo
import pandas as pd
import pyarrow.parquet as pq
import pytest
from command import COMMAND, merge_cosim
from running import Running
from scene_files import ROUTES, own_files, small_scene

from merge_cosim.core.errors import UserError
from merge_cosim.sumo.listener import StepListener
from merge_cosim.sweeps.listener import HostListener


def rows(folder):
    return pq.read_table(folder / "results.parquet")


def table(file):
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def swept(tmp_path, *arguments, out="out"):
    done = merge_cosim("sweep", *arguments, "--out", out, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    return tmp_path / out, done


@pytest.fixture(scope="module")
def minute(tmp_path_factory):
    """A sweep of two scenes under two methods; and the first scene's files."""
    folder = tmp_path_factory.mktemp("minute")
    small_scene(folder)
    done = merge_cosim("export", "minute.toml", "--case", "000", "--out", "files", cwd=folder)
    assert done.stdout.strip().endswith("traffic.sumocfg")
    out, done = swept(folder, "minute.toml", "--method", "acc", "--method", "always-yield", "--jobs", "2")
    return folder, out, done


def test_meetings_become_rows_and_the_traffic_is_described_as_a_whole(minute):
    _, out, done = minute
    found = rows(out).to_pandas()
    assert set(found["source"]) == {"traffic"}
    assert found["case"].str.fullmatch(r"00[01]/host\.\d+/merging\.\d+").all()
    assert set(found["method"]) == {"acc", "always-yield"}
    assert (found["min_leader_gap_m"].dropna() > -5).all()
    scenes = table(out / "scenes.csv")
    assert [(one["method"], one["scene"]) for one in scenes] == [
        (method, f"{scene:03d}") for method in ("acc", "always-yield") for scene in range(2)
    ]
    traffic = {one["method"]: one for one in table(out / "traffic.csv")}
    for method, one in traffic.items():
        own = found[found["method"] == method]
        assert int(one["meetings_scored"]) == len(own) > 5
        assert float(one["throughput_veh_h"]) > 0
    assert "the traffic as a whole" in done.stdout
    summary = {row["method"]: row for row in json.loads((out / "summary.json").read_text())}
    assert summary["acc"]["against"] is None  # in living traffic no two methods have a case in common
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["real_time_factor"] > 5


def test_events_are_reported_in_one_line_each_and_listed(minute):
    _, out, done = minute
    notes = table(out / "notes.csv")
    two_hosts = [note for note in notes if note["event"] == "two_hosts"]
    assert two_hosts
    assert f"two hosts: {len(two_hosts)}, such as: merging car" in done.stderr
    counted = sum(int(one["two_hosts"]) for one in table(out / "scenes.csv"))
    assert counted == len(two_hosts)


def test_the_same_bytes_for_any_number_of_processes(minute):
    folder, out, _ = minute
    alone, _ = swept(folder, "minute.toml", "--method", "always-yield", "--method", "acc", "--jobs", "1", out="alone")
    for name in ("results.parquet", "scenes.csv", "traffic.csv", "notes.csv"):
        assert (alone / name).read_bytes() == (out / name).read_bytes(), name


def test_a_killed_sweep_goes_on_to_the_same_rows(minute):
    folder, out, _ = minute
    command = [*COMMAND, "sweep", "minute.toml", "--method", "acc"]
    command += ["--method", "always-yield", "--jobs", "1", "--out", "killed"]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None and not list((folder / "killed").glob("parts/*.parquet")):
        time.sleep(0.02)
    process.kill()
    process.wait()
    resumed, _ = swept(folder, "minute.toml", "--method", "acc", "--method", "always-yield", "--resume", out="killed")
    for name in ("results.parquet", "scenes.csv", "traffic.csv"):
        assert (resumed / name).read_bytes() == (out / name).read_bytes(), name


def test_one_scene_and_one_meeting_alone(minute):
    folder, out, _ = minute
    case = next(one for one in rows(out).to_pylist() if one["method"] == "acc")
    how = ("run", "minute.toml", "--method", "acc", "--json", "--case")
    alone = json.loads(merge_cosim(*how, case["case"], "--trace", "one.csv", cwd=folder).stdout)
    assert {name: value for name, value in alone.items() if "log_odds" not in name} == {
        name: value for name, value in case.items() if "log_odds" not in name
    }
    trace = pd.read_csv(folder / "one.csv")
    assert set(trace["case"]) == {case["case"]}
    if case["min_leader_gap_m"] is not None:  # the last state is no cycle of the trace, but is scored
        assert trace["leader_gap_m"].min() >= case["min_leader_gap_m"] > trace["leader_gap_m"].min() - 3.0
    scene = json.loads(merge_cosim(*how, "001", "--fcd", "f.xml", cwd=folder).stdout)
    stored = next(one for one in table(out / "scenes.csv") if (one["method"], one["scene"]) == ("acc", "001"))
    assert {name: str(scene[name]) for name in ("meetings", "throughput_veh_h", "two_hosts")} == {
        name: stored[name] for name in ("meetings", "throughput_veh_h", "two_hosts")
    }
    assert "host.0" in (folder / "f.xml").read_text()
    for wrong, expected in (("9", "no case '9'"), ("001/host.0/x", "no encounter '001/host.0/x' is scored under acc")):
        done = merge_cosim(*how, wrong, cwd=folder)
        assert (done.returncode, done.stdout) == (2, "")
        assert expected in done.stderr


def test_exported_files_give_the_same_scene(minute):
    folder, out, _ = minute
    own, _ = swept(folder, "files/traffic.sumocfg", "--method", "acc", out="own")
    expected = [one["distance_m"] for one in rows(out).to_pylist() if one["method"] == "acc" and one["case"] < "001"]
    assert [one["distance_m"] for one in rows(own).to_pylist()] == expected
    again = merge_cosim("export", "files/traffic.sumocfg", "--case", "000", "--out", "x", cwd=folder)
    assert again.returncode == 2
    assert "is a SUMO configuration already" in again.stderr


def test_a_report_of_living_traffic(minute):
    folder, out, _ = minute
    done = merge_cosim("report", out, cwd=folder)
    assert done.returncode == 0, done.stderr
    page = (out / "report.html").read_text()
    assert "SUMO&#39;s own traffic" in page or "SUMO's own traffic" in page
    assert "The traffic as a whole" in page
    assert (out / "tables" / "traffic.csv").is_file()
    compared = merge_cosim("compare", out, out, cwd=folder)
    assert compared.returncode == 2
    assert "meetings in living traffic are never the same" in compared.stderr


def test_route_files_of_ones_own_just_run(tmp_path):
    own_files(tmp_path)
    out, _ = swept(tmp_path, "my.sumocfg", "--method", "pgm", "--method", "acc")
    found = rows(out).to_pandas()
    assert found["case"].str.startswith("000/h.").all()
    assert found["case"].str.contains("/joining").all()  # no type says merging, so all cars on the on-ramp are
    assert set(found["method"]) == {"acc", "pgm"}


def test_a_host_can_be_named_in_other_peoples_files(tmp_path):
    own_files(tmp_path, ROUTES.replace('<param key="merge-cosim.role" value="host"/>', ""))
    done = merge_cosim("sweep", "my.sumocfg", "--method", "acc", cwd=tmp_path)
    assert done.returncode == 2
    assert "my.sumocfg: no car is the host; add <param" in done.stderr
    out, _ = swept(tmp_path, "my.sumocfg", "--method", "acc", "--set", "encounters.host=host")
    assert len(rows(out)) > 0


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('edges="ramp weave', 'edges="rampe weave', "The edge 'rampe' within the route"),
        ('type="host" route="main"', 'type="host" route="mine"', "The route 'mine' for flow 'h' is not known"),
        ("</routes>", "", "my.rou.xml: not XML"),
        ('departSpeed="15"', 'departSpeed="fast"', "my.sumocfg: SUMO cannot start: Invalid departSpeed definition"),
    ],
)
def test_a_mistake_in_a_route_file_is_one_line(tmp_path, old, new, expected):
    own_files(tmp_path, ROUTES.replace(old, new))
    done = merge_cosim("sweep", "my.sumocfg", "--method", "acc", cwd=tmp_path)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_mistake_that_sumo_meets_on_the_way(tmp_path):
    late = '<vehicle id="late" type="car" depart="30"><route edges="main_in nowhere"/></vehicle></routes>'
    own_files(tmp_path, ROUTES.replace("</routes>", late))
    done = merge_cosim("sweep", "my.sumocfg", "--method", "acc", cwd=tmp_path)
    assert done.returncode == 2
    assert "my.sumocfg: SUMO " in done.stderr
    assert "nowhere" in done.stderr


def car(name, depart, edges):
    kind = "host" if name.startswith("h") else "car"
    lane = f'departLane="0" departSpeed="15"><route edges="{edges} weave main_out"/></vehicle>'
    return f'<vehicle id="{name}" type="{kind}" depart="{depart}" {lane}'


HEAD = '<routes><vType id="host"><param key="merge-cosim.role" value="host"/></vType><vType id="car"/>'


def test_vehicles_that_sumo_leaves_out_of_an_unsorted_file_are_counted(tmp_path):
    cars = [car("h1", 5, "main_in"), car("m1", 6, "ramp"), car("late", 1, "main_in"), car("m2", 2, "ramp")]
    own_files(tmp_path, HEAD + "".join(cars) + "</routes>", '<end value="60"/>')
    _, done = swept(tmp_path, "my.sumocfg", "--method", "acc")
    assert "vehicles not departed: 2, such as: vehicle late never departed: SUMO left it out" in done.stderr
    (tmp_path / "my.rou.xml").write_text(HEAD + "".join(cars[2:] + cars[:2]) + "</routes>")
    _, done = swept(tmp_path, "my.sumocfg", "--method", "acc", out="sorted")
    assert "not_departed" not in done.stderr


UNUSED = '<vType id="unused"><param key="merge-cosim.role" value="merging"/></vType>'


@pytest.mark.parametrize(
    ("how", "edge", "kind", "why"),
    [
        (("sweep",), "main_in", "", "none drives over the on-ramp"),
        (("run", "--case", "000"), "main_in", "", "none drives over the on-ramp"),
        (("sweep",), "ramp", UNUSED, "none is of a type with the role merging"),
    ],
)
def test_a_scene_without_a_car_that_is_to_merge_is_one_line(tmp_path, how, edge, kind, why):
    cars = [car("h1", 5, "main_in"), car("o", 6, edge)]
    own_files(tmp_path, HEAD + kind + "".join(cars) + "</routes>", '<end value="60"/>')
    done = merge_cosim(how[0], "my.sumocfg", "--method", "acc", *how[1:], cwd=tmp_path)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "nothing to measure: no car came in that is to merge: " + why in done.stderr


def test_hosts_that_never_depart_are_reported(tmp_path):
    blocked = '<vehicle id="block" type="car" depart="0" departLane="0" departPos="8" departSpeed="0" route="main">'
    blocked += '<stop lane="main_in_0" endPos="9" duration="1000"/></vehicle><flow id="joining"'
    late = '<vehicle id="late" type="host" depart="61" route="main"/></routes>'
    routes = ROUTES.replace('<flow id="joining"', blocked, 1).replace("</routes>", late)
    own_files(tmp_path, routes, '<end value="60"/>')
    done = merge_cosim("sweep", "my.sumocfg", "--method", "acc", cwd=tmp_path)
    assert done.returncode == 2
    assert "out: my: nothing to measure: no host came in" in done.stderr
    assert "; host h.0 never departed: no room where it was to enter" in done.stderr
    out = tmp_path / "out"
    assert len([note for note in table(out / "notes.csv") if note["event"] == "hosts_not_departed"]) == 9
    assert "host late never departed: not in the scene's time" in (out / "notes.csv").read_text()
    assert len(rows(out)) == 0
    report = merge_cosim("report", out, cwd=tmp_path)
    assert report.returncode == 2
    assert "nothing to report: no car merged next to a host" in report.stderr


@pytest.fixture(scope="module")
def short(minute):
    """Files of a shorter scene, and its meetings under PGM."""
    folder, _, _ = minute
    demand = ("--set", "encounters.demand.duration=35")
    merge_cosim("export", "minute.toml", "--case", "000", *demand, "--out", "short", cwd=folder)
    own, _ = swept(folder, "short/traffic.sumocfg", "--method", "pgm", out="own-short")
    return folder, rows(own).to_pandas()


@pytest.mark.parametrize("module", ["traci", "libsumo"])
def test_the_script_of_the_page_finds_the_same_meetings(short, module):
    folder, theirs = short
    page = Path(__file__).parents[2] / "docs" / "traffic.md"
    (script,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert len([line for line in script.splitlines() if line and not line.startswith("#")]) <= 11
    script = script.replace("import traci  #", f"import {module} as traci  #")
    script = script.replace("traci.close()", "listener.results().to_parquet('mine.parquet')\ntraci.close()")
    (folder / "my_script.py").write_text(script)
    command = [sys.executable, "my_script.py", "short/traffic.sumocfg"]
    activated = os.environ | {"PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}
    done = subprocess.run(command, cwd=folder, env=activated, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    mine = pd.read_parquet(folder / "mine.parquet").sort_values("case", ignore_index=True)
    named = ["scenario", "site"]
    pd.testing.assert_frame_equal(mine.drop(columns=named), theirs.drop(columns=named))
    assert mine["case"][0] in done.stdout


@pytest.mark.parametrize(
    ("step", "several", "ramp", "expected"),
    [
        ("0.2", 0.0, "us101", "start SUMO with --step-length 0.1"),
        ("0.1", 0.0, "designed", "HostListener: SUMO has another net: no lane main_out_0 of"),
        ("0.1", 1.0, "us101", r"several steps at once; call simulationStep\(\) without a time"),
    ],
)
def test_a_listener_refuses_other_conditions(minute, step, several, ramp, expected):
    folder, _, _ = minute
    scene = str(folder / "files/traffic.sumocfg")

    assert issubclass(HostListener, StepListener)  # SUMO takes no other

    def drive():
        number = libsumo.addStepListener(HostListener(libsumo, ramp, "acc"))
        try:
            libsumo.simulationStep(several)
        finally:
            libsumo.removeStepListener(number)  # closing SUMO does not

    libsumo.start(["sumo", "-c", scene, "--no-step-log", "true", "--step-length", step])
    try:
        with pytest.raises(UserError, match=expected):
            drive()
    finally:
        libsumo.close()


def test_in_a_sumo_that_runs_already(minute):
    folder, _, _ = minute
    with Running("us101", "-r", "files/traffic.rou.xml", "--seed", "0", "--end", "60", cwd=folder) as address:
        case = ("run", "files/traffic.sumocfg", "--case", "000", "--method", "acc", "--json")
        attached = json.loads(merge_cosim(*case, "--attach", address, cwd=folder).stdout)
    own = json.loads(merge_cosim(*case, cwd=folder).stdout)
    assert attached["meetings"] > 0
    of_trips = ("mean_speed", "time_loss_s")  # SUMO knows these only where it was asked for trips
    assert {k: v for k, v in attached.items() if k not in of_trips} == {
        k: v for k, v in own.items() if k not in of_trips
    }


def test_settings_of_scenes(minute):
    folder, _, _ = minute
    how = ("sweep", "minute.toml", "--method", "acc", "--set", "encounters.replications=1", "--out", "varied")
    done = merge_cosim(*how, "--vary", "encounters.demand.car_following=IDM,Krauss", cwd=folder)
    assert done.returncode == 0, done.stderr
    traffic = table(folder / "varied" / "traffic.csv")
    assert [one["variation"] for one in traffic] == [
        "",
        "encounters.demand.car_following=IDM",
        "encounters.demand.car_following=Krauss",
    ]
    assert len({one["time_loss_s"] for one in traffic}) == 3
    for setting, expected in (
        ("encounters.demand.throug=1", "did you mean 'through'?"),
        ("encounters.demand.car_following=Krauß", "car_following = 'Krauß'"),
        ("encounters.demand.hosts=-1", "hosts = -1"),
        ("merging.model=designed", "merging.model must be 'sumo'"),
    ):
        wrong = merge_cosim(*how[:-1], "wrong", "--set", setting, cwd=folder)
        assert wrong.returncode == 2
        assert expected in wrong.stderr

"""Other people's files through the real command line: SUMO's own examples, and what can go wrong in them."""

import csv
import json
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import sumo
from command import merge_cosim
from scene_files import ROUTES, own_files

GAMES = Path(sumo.SUMO_HOME) / "tools" / "game"
PAGE = Path(__file__).parents[2] / "docs" / "traffic.md"


def game(folder: Path, name: str, *words: str) -> None:
    """Copy one of SUMO's example games and describe its net."""
    for each in (name, f"{name}.sumocfg", "input_additional.add.xml"):
        source = GAMES / each
        (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / each)
    (net,) = (folder / name).glob("*.net.xml")
    done = merge_cosim("ramp", "describe", str(net), *words, cwd=folder)
    assert done.returncode == 0, done.stderr


def table(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


@pytest.mark.slow
def test_the_commands_of_the_page(tmp_path: Path) -> None:
    (block,) = re.findall(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    script = block.replace("--out", "--set encounters.end=100 --out")
    copy, *commands = script.splitlines()
    environment = os.environ | {"SUMO_HOME": sumo.SUMO_HOME}
    subprocess.run(["bash", "-euc", copy], cwd=tmp_path, env=environment, check=True)
    for name, *words in map(shlex.split, commands):
        assert name == "merge-cosim"
        done = merge_cosim(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    found = pq.read_table(tmp_path / "out" / "ramp" / "results.parquet").to_pandas()
    assert set(found["method"]) == {"acc", "pgm"}
    assert found["case"].str.match(r"000/highway1\.\d+/onramp\.\d+").all()


def test_a_folder_by_a_shipped_ramps_name_is_ones_own(tmp_path: Path) -> None:
    game(tmp_path, "ramp")
    (tmp_path / "ramp").rename(tmp_path / "us101")
    file = tmp_path / "ramp.sumocfg"
    file.write_text(file.read_text().replace('"ramp/', '"us101/'))
    how = ("--case", "000", "--method", "acc", "--set", "encounters.host=highway1", "--set", "encounters.end=30")
    scene = json.loads(merge_cosim("run", file.name, *how, "--json", cwd=tmp_path).stdout)
    assert scene["hosts"] > 0


@pytest.mark.slow
def test_a_motorway_from_openstreetmap(tmp_path: Path) -> None:
    """Cars and trucks from seven route files on a net with more than the ramp; the configuration talks and errs."""
    game(tmp_path, "A10KW", "--link", "24498409")
    how = (
        "A10KW.sumocfg",
        "--method",
        "acc",
        "--set",
        "encounters.host=veh_mw_passenger",
        "--set",
        "encounters.end=100",
    )
    done = merge_cosim("sweep", *how, "--out", "out", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    json.loads(done.stdout)
    found = pq.read_table(tmp_path / "out" / "results.parquet").to_pandas()
    assert len(found) > 0
    assert found["case"].str.match(r"000/veh_mw\d+/veh\d+").all()
    (scene,) = table(tmp_path / "out" / "scenes.csv")
    assert float(scene["simulated_s"]) == 100.0


def test_a_configuration_of_everything(tmp_path: Path) -> None:
    """Another begin, sublanes, persons, stops, zones, rerouting, outputs, and a port that SUMO would wait at."""
    game(tmp_path, "ramp")
    (tmp_path / "more.add.xml").write_text("""<additional>
<vType id="own"/><vType id="bus" vClass="bus"/><busStop id="stop" lane="gneE11_0" startPos="500" endPos="530"/>
<taz id="A" edges="gneE15"/><taz id="B" edges="gneE11"/></additional>""")
    (tmp_path / "more.rou.xml").write_text("""<routes>
<flow id="own" type="own" begin="3600" end="3660" period="6" departLane="1" departSpeed="max" from="gneE2" to="gneE11"/>
<flow id="zone" fromTaz="A" toTaz="B" begin="3600" end="3660" period="6"/>
<person id="p" depart="3602"><ride from="gneE2" to="gneE11" lines="bus"/></person>
<vehicle id="bus" type="bus" depart="3603"><route edges="gneE2 offramp gneE3 gneE7 gneE8 gneE11"/>
<stop busStop="stop" duration="5"/></vehicle><trip id="t" depart="3604" from="gneE15" to="gneE9"/></routes>""")
    (tmp_path / "all.sumocfg").write_text("""<sumoConfiguration><n value="ramp/ramp.net.xml"/><r value="more.rou.xml"/>
<a value="more.add.xml"/><b value="1:00:00"/><e value="3700"/><step-length value="1"/><lateral-resolution value="0.8"/>
<collision.action value="teleport"/><device.rerouting.probability value="1"/><tripinfo value="trips.xml"/>
<verbose value="true"/><remote-port value="9999"/></sumoConfiguration>""")
    how = ("run", "all.sumocfg", "--case", "000", "--method", "acc", "--set", "encounters.host=own", "--json")
    scene = json.loads(merge_cosim(*how, "--trace", "trace.csv", cwd=tmp_path).stdout)
    assert (scene["simulated_s"], scene["hosts"]) == (100.0, 10)
    assert scene["meetings"] > 0
    times = [float(row["time_s"]) for row in table(tmp_path / "trace.csv")]
    assert 3600.0 < min(times) < max(times) <= 3700.0
    assert (tmp_path / "trips.xml").is_file()


def test_a_host_that_nobody_is(tmp_path: Path) -> None:
    game(tmp_path, "ramp")
    how = ("sweep", "ramp.sumocfg", "--method", "acc", "--set", "encounters.end=20")
    wrong = merge_cosim(*how, "--set", "encounters.host=highway", cwd=tmp_path)
    assert wrong.returncode == 2
    assert "no vehicle, flow or type of its files has this id; did you mean 'highway" in wrong.stderr
    several = merge_cosim(*how, "--set", "encounters.host=DEFAULT_VEHTYPE", cwd=tmp_path)
    assert "it stands for several types; choose one: truck, passenger" in several.stderr
    none = merge_cosim(*how, "--set", "encounters.host=onramp", "--out", "none", cwd=tmp_path)
    assert none.returncode == 2
    assert "none: ramp: nothing to measure: no host came in that drives along the main road" in none.stderr


@pytest.mark.parametrize(("kept", "expected"), [(5000, "us101.net.xml: not a SUMO net"), (0, "us101.net.xml: not XML")])
def test_a_broken_net_is_one_line(tmp_path: Path, kept: int, expected: str) -> None:
    own_files(tmp_path)
    net = tmp_path / "us101.net.xml"
    net.write_bytes(net.read_bytes()[:kept])
    done = merge_cosim("sweep", "my.sumocfg", "--method", "acc", cwd=tmp_path)
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_file_that_sumo_misses_is_one_line(tmp_path: Path) -> None:
    own_files(tmp_path, more='<gui-settings-file value="none.xml"/>')
    done = merge_cosim("sweep", "my.sumocfg", "--method", "acc", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.strip().endswith("File 'none.xml' is not accessible (No such file or directory).")
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("removed", ["true", "false"])
def test_teleports_and_contacts_of_others_are_reported_and_counted(tmp_path: Path, removed: str) -> None:
    trouble = """
<vehicle id="block" type="car" depart="0" departPos="300" departSpeed="0"><route edges="ramp weave main_out"/>
<stop lane="ramp_0" endPos="310" duration="12"/></vehicle>
<vehicle id="jam" type="car" depart="0" departPos="290" departSpeed="0"><route edges="ramp weave main_out"/></vehicle>
<vehicle id="o1" type="car" depart="0" route="main" departLane="3" departPos="200" insertionChecks="none"/>
<vehicle id="o2" type="car" depart="0" route="main" departLane="3" departPos="203" insertionChecks="none"/>
"""
    options = f'<time-to-teleport value="5"/><time-to-teleport.remove value="{removed}"/><end value="60"/>'
    own_files(tmp_path, ROUTES.replace('<flow id="joining"', trouble + '<flow id="joining"', 1), options)
    done = merge_cosim("sweep", "my.sumocfg", "--method", "acc", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (traffic,) = table(tmp_path / "out" / "traffic.csv")
    notes = table(tmp_path / "out" / "notes.csv")
    note = "SUMO took out a vehicle" if removed == "true" else "vehicle jam was teleported by SUMO"
    for event, what in (
        ("teleports", note),
        ("other_contacts", "SUMO reports a contact of o1 and o2 on lane main_in_3"),
    ):
        lines = [note["what"] for note in notes if note["event"] == event]
        assert any(what in line for line in lines), (event, lines)
        assert int(float(traffic[event])) == len(lines)
        assert f"{event.replace('_', ' ')}: {len(lines)}, such as: " in done.stderr


def test_a_configuration_without_a_described_net_infers_its_ramp_and_says_so(tmp_path: Path) -> None:
    for each in ("ramp", "ramp.sumocfg", "input_additional.add.xml"):
        source = GAMES / each
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / each)
    words = ("sweep", "ramp.sumocfg", "--method", "acc", "--set", "encounters.end=100")
    # A whole number is an id like any other; no car of these files has it.
    done = merge_cosim(*words, "--set", "encounters.host=7", cwd=tmp_path)
    assert (done.returncode, "no vehicle, flow or type of its files has this id" in done.stderr) == (2, True), (
        done.stderr
    )
    assert "the on-ramp was inferred: ramp/ramp.toml, drawn in ramp.png there" in done.stderr
    assert (tmp_path / "ramp" / "ramp.png").is_file()

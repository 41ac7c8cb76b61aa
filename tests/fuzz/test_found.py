"""What the long run has found: each damaged input once more, with the line that it gets."""

import json
import re
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command import merge_cosim, refused
from fuzz_inputs import CONFIG, GRID, PLUGIN, ROUTES, episode_table, trajectories, trajectory_table

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.estimators.learned.model import MODELS, IntentionModel
from merge_cosim.ngsim.pairing.episodes import episode_tracks
from merge_cosim.ngsim.sites import read_site, site
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.view import netedit_view
from merge_cosim.results.notes import note_lines
from merge_cosim.results.store import ResultFolder
from merge_cosim.scenarios.settings import parse_variation
from merge_cosim.sumo.tiles import tile_net


def test_a_short_row_with_bytes_that_are_no_text(tmp_path: Path) -> None:
    lines = trajectories(",", True).splitlines()
    lines[8] = b"2,\xde\xff,3"
    (tmp_path / "t.csv").write_bytes(b"\n".join(lines) + b"\n")
    assert "t.csv, from line 2 on: CSV parse error" in refused("ngsim", "summary", "t.csv", cwd=tmp_path)


def test_a_parquet_file_with_a_column_of_minus_192_values(tmp_path: Path) -> None:
    file = tmp_path / "t.parquet"
    pq.write_table(trajectory_table(), file)
    content = bytearray(file.read_bytes())
    number = content.index(b"\x16\xc0\x02", content.rindex(b"Location"))  # 160 in its metadata
    content[number + 1] = 0xFF
    file.write_bytes(content)
    column = pq.read_metadata(file).row_group(0).column(trajectory_table().column_names.index("Location"))
    assert column.num_values == -192
    assert "t.parquet: damaged or cut short" in refused("ngsim", "import", "t.parquet", "--out", "o", cwd=tmp_path)


def test_a_clock_that_is_no_time(tmp_path: Path) -> None:
    text = trajectories("  ", False)
    for clock in (b"99999999999999999999", b"-5", b"1118846978900000"):
        (tmp_path / "t.txt").write_bytes(text.replace(b"1118846978900", clock))
        line = refused("ngsim", "import", "t.txt", "--out", "o", "--site", "us101", cwd=tmp_path)
        assert "t.txt: Global_Time does not advance by 100 ms per Frame_ID" in line


def test_columns_of_other_kinds_and_twice(tmp_path: Path) -> None:
    file = tmp_path / "e.parquet"
    numbers = {name: pa.array([0.0]) for name in ("episode", "frame", "car", "station_m", "speed_m_s")}
    pq.write_table(pa.table(numbers | {"car": pa.array([{"a": 1}])}), file)
    assert "column 'car' holds something that is not a number" in refused("ngsim", "summary", file, cwd=tmp_path)
    rows = [line.split(b",") for line in trajectories(",", True, True).splitlines()]
    columns = {name.decode(): [row[at].decode() for row in rows[1:]] for at, name in enumerate(rows[0])}
    table = pa.table(columns)
    command = ("ngsim", "import", "t.parquet", "--out", "o")
    pq.write_table(table.append_column("Lane_ID", table["Lane_ID"]), tmp_path / "t.parquet")
    assert "t.parquet: two columns are called Lane_ID; remove one" in refused(*command, cwd=tmp_path)
    pq.write_table(table.append_column("LANE_ID", table["Lane_ID"]), tmp_path / "t.parquet")
    assert "t.parquet: two columns are called Lane_ID; remove one" in refused(*command, cwd=tmp_path)
    pq.write_table(table.append_column("smoothed", pa.array([[True]] * len(table))), tmp_path / "t.parquet")
    assert "t.parquet: its columns cannot be taken as trajectories" in refused(*command, cwd=tmp_path)


def test_a_column_whose_name_is_no_text(tmp_path: Path) -> None:
    pq.write_table(trajectory_table(), tmp_path / "t.parquet", store_schema=False)
    content = (tmp_path / "t.parquet").read_bytes()
    (tmp_path / "t.parquet").write_bytes(content.replace(b"Lane_ID", b"Lane\xffID"))
    line = refused("ngsim", "import", "t.parquet", "--out", "o", cwd=tmp_path)
    assert "t.parquet: damaged or cut short" in line
    pq.write_table(episode_table(), tmp_path / "e.parquet", store_schema=False)
    content = (tmp_path / "e.parquet").read_bytes()
    (tmp_path / "e.parquet").write_bytes(content.replace(b"speed_m_s", b"speed\xffm_s"))
    with pytest.raises(UserError, match=r"e\.parquet: not a readable Parquet file"):
        episode_tracks(tmp_path / "e.parquet", site("us101"), site("us101").pairs)


def test_a_net_whose_path_has_no_connection(tmp_path: Path) -> None:
    shutil.copytree(shipped("sumo_nets") / "designed", tmp_path, dirs_exist_ok=True)
    net = tmp_path / "designed.net.xml"
    kept = [line for line in net.read_text().splitlines() if '<connection from="ramp"' not in line]
    net.write_text("\n".join(kept))
    (tmp_path / "my.rou.xml").write_text(ROUTES)
    (tmp_path / "my.sumocfg").write_text(CONFIG)
    words = ("run", "my.sumocfg", "--case", "h0_m0", "--method", "acc")
    assert "merging_lane: no connection in the net from ramp_0 to main_out_0" in refused(*words, cwd=tmp_path)
    line = refused(*words, "--unchecked-ramp", cwd=tmp_path)
    assert "SUMO cannot drive the ramp's paths: Vehicle 't0.merging' has no valid route" in line


def test_a_column_of_true_and_false_holds_no_numbers(tmp_path: Path) -> None:
    table = trajectory_table()
    pq.write_table(table.set_column(13, "Lane_ID", pa.array([True] * len(table))), tmp_path / "t.parquet")
    line = refused("ngsim", "import", "t.parquet", "--out", "o", cwd=tmp_path)
    assert line.endswith("t.parquet: Lane_ID holds true and false, not numbers")


@pytest.mark.parametrize(
    ("stands", "written", "fault"),
    [
        ("gore = 613.0", "gore = true", "recording.gore: Input should be a valid number"),
        ("ramp = [6, 7]", "ramp = [true, 7]", "lanes.ramp.0: Input should be a valid integer"),
        ("6_453_200.0]", "inf]", r"recording.global_x.1: Input should be a finite number"),
        ("[1_871_450.0", "[nan", r"recording.global_y.0: Input should be a finite number"),
    ],
)
def test_a_site_with_what_is_no_number(tmp_path: Path, stands: str, written: str, fault: str) -> None:
    text = (shipped("sumo_nets") / "us101" / "site.toml").read_text()
    assert stands in text
    (tmp_path / "site.toml").write_text(text.replace(stands, written))
    with pytest.raises(UserError, match=rf"site\.toml: {fault}"):
        read_site(tmp_path)


@pytest.mark.parametrize("written", ["1:2:inf", "1:0:1e20", "x:0:1"])
def test_a_variation_without_an_end_or_backwards(written: str) -> None:
    with pytest.raises(UserError, match="write NAME=A:B:STEP with A <= B"):
        parse_variation(f"acc.headway={written}")


@pytest.mark.parametrize(
    ("stands", "written"),
    [
        ('length="500.00" width', 'length="inf" width'),
        (
            '<edge id="main_in"',
            '<edge id="main_in" from="main_start" to="gore">'
            '<lane id="main_in_0" index="0" speed="1" length="2" shape="0,0 1,0"/></edge>'
            '<edge id="main_in"',
        ),
    ],
)
def test_a_net_with_lengths_that_are_none(tmp_path: Path, stands: str, written: str) -> None:
    folder = shipped("sumo_nets") / "designed"
    net = (folder / "designed.net.xml").read_text()
    (tmp_path / "designed.net.xml").write_text(net.replace(stands, written, 1))
    shutil.copy(folder / "ramp.toml", tmp_path)
    with pytest.raises(
        UserError, match=r"ramp\.toml: main: in the net designed\.net\.xml the lanes of edge 'main_in' are"
    ):
        Ramp.load(tmp_path)


@pytest.mark.parametrize("cell", [[-1, 3, 1], [0, 30, 1], [0.5, 3, 1], [11, 15, 1], [0, 0, 1e16], [0, 0, 0]])
def test_a_model_with_a_cell_that_is_none(tmp_path: Path, cell: list[float]) -> None:
    document = json.loads((MODELS / "us101-surrogate.json").read_text())
    document["arrivals"]["NOT_YIELD"].append(cell)
    file = tmp_path / "m.json"
    file.write_text(json.dumps(document))
    with pytest.raises(UserError, match=r"m\.json: not a merge-cosim model"):
        IntentionModel.load(file)


def test_a_model_with_a_broken_count(tmp_path: Path) -> None:
    document = json.loads((MODELS / "us101-surrogate.json").read_text())
    document["transitions"]["1"]["YIELD"][0][2] = 1.5
    (tmp_path / "m.json").write_text(json.dumps(document))
    with pytest.raises(UserError, match="a count of transitions is not whole"):
        IntentionModel.load(tmp_path / "m.json")


def test_a_view_that_is_no_xml(tmp_path: Path) -> None:
    (tmp_path / "view.xml").write_bytes(b"<viewsettings \xd7")
    with pytest.raises(UserError, match=r"view\.xml: not XML"):
        netedit_view(tmp_path, tmp_path)


@pytest.mark.parametrize(
    ("stands", "written", "fault"),
    [
        (
            "def update(self, seen)",
            "def update(seen)",
            "Mine.update: too many positional arguments; it is called as update(",
        ),
        ("def update", "def updates", "Mine: it has no method 'update', which every estimator needs"),
        (
            "@estimators.register",
            "@estimators.register\n@__import__('dataclasses').dataclass(frozen=True)",
            "Mine: a frozen dataclass cannot",
        ),
        ("return np.where", "return str #", "Mine: gives <class 'str'>, where 1 numbers are due"),
    ],
)
def test_a_plugin_with_a_method_that_does_not_fit(tmp_path: Path, stands: str, written: str, fault: str) -> None:
    (tmp_path / "p.py").write_text(PLUGIN.replace(stands, written))
    case = ("--case", "d+0_h15_m15", "--method", "mine", "--plugin", "p.py", "--world", "closed-form")
    assert fault in refused("run", "designed-2", *case, cwd=tmp_path)


def test_a_result_folder_with_one_other_byte(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(GRID)
    words = ("--method", "acc", "--world", "closed-form", "--jobs", 1, "--out", "out")
    done = merge_cosim("sweep", "s.toml", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = ResultFolder(tmp_path / "out")
    for name, read in (("results.parquet", folder.results), ("traces.parquet", folder.traces.read)):
        file = tmp_path / "out" / name
        content = bytearray(file.read_bytes())
        page = pq.read_metadata(file).row_group(0).column(2)
        content[page.dictionary_page_offset + page.total_compressed_size - 1] ^= 1  # the last byte of its data
        file.write_bytes(content)
        with pytest.raises(UserError, match=rf"{name}: damaged"):
            read()
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    for rows, why in (
        ([summary[0], summary[0] | {"n": "27"}], "n is '27'"),
        ([summary[0], summary[0] | {"source": None}], "source is None"),
        ([summary[0], {"scenario": "s"}], "rows of different columns"),
        ({"scenario": "s"}, "no list of rows"),
    ):
        (tmp_path / "out/summary.json").write_text(json.dumps(rows))
        assert f"summary.json: damaged ({why}); run the sweep again" in refused("summary", "out", cwd=tmp_path)
    for content in (b"scenario,n\nx,\xff", b"scenario,n\nx", b"outside_support,n\n1,y"):
        (tmp_path / "out/summary.csv").write_bytes(content)
        with pytest.raises(UserError, match=r"summary\.csv: damaged"):
            note_lines(folder)


@pytest.mark.parametrize("hint", ["{}", "'nothing.here'"])
def test_a_type_hint_that_is_none(tmp_path: Path, hint: str) -> None:
    (tmp_path / "p.py").write_text(PLUGIN.replace("bias: float", f"bias: {hint}"))
    line = refused("sweep", "designed-2", "--plugin", "p.py", "--method", "mine", "--out", "out", cwd=tmp_path)
    assert "p.py: class Mine: a type hint cannot be used (" in line


@pytest.mark.parametrize(
    ("broken", "first"), [({"0x1": 1}, {"contact": "c"}), ({"contact": 1}, {}), ({"contact": "1"}, {"contact": "c"})]
)
def test_invariants_that_are_none(tmp_path: Path, broken: dict[str, object], first: dict[str, str]) -> None:
    found = {"invariants": {"encounters": 3, "broken": broken, "first": first}}
    (tmp_path / "manifest.json").write_text(json.dumps(found))
    with pytest.raises(UserError, match=r"manifest\.json: damaged \(invariants: no counts with a first case each\)"):
        ResultFolder(tmp_path).invariants()


def test_a_condition_with_a_part_of_constants(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(GRID)
    words = ("--method", "acc", "--world", "closed-form", "--jobs", 1, "--out", "out")
    assert merge_cosim("sweep", "s.toml", *words, cwd=tmp_path).returncode == 0
    for condition in ("stuck | (not -1 != 'x')", "method == 'acc' == 'acc'", "stuck | (not inf > 18.0)"):
        line = refused("cases", "out", "--where", condition, cwd=tmp_path)
        assert "a part of it names no column; write one such as" in line
    assert merge_cosim("cases", "out", "--where", "0 <= delay_s < 5", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("speed", ["144.44", "0.00"])
def test_a_road_whose_speed_limit_is_none_that_a_ramp_can_have(tmp_path: Path, speed: str) -> None:
    net = (shipped("sumo_nets") / "us101" / "us101.net.xml").read_text()
    (tmp_path / "my.net.xml").write_text(re.sub(' speed="[^"]*"', f' speed="{speed}"', net))
    for words in (("new", "mine", "--from-net", "my.net.xml"), ("describe", "my.net.xml")):
        line = refused("ramp", *words, cwd=tmp_path)
        assert re.search(rf"my\.net\.xml: the speed limit of 'weave' is {float(speed):g} m/s; give another with", line)


@pytest.mark.parametrize("offset", ["1e999", "1e999,0.00", "0,1,2", "", "a,b"])
def test_a_net_whose_offset_is_not_two_numbers(tmp_path: Path, offset: str) -> None:
    net = (shipped("sumo_nets") / "us101" / "us101.net.xml").read_text()
    (tmp_path / "my.net.xml").write_text(re.sub('netOffset="[^"]*"', f'netOffset="{offset}"', net, count=1))
    line = refused("ramp", "new", "mine", "--from-net", "my.net.xml", cwd=tmp_path)
    assert f"the netOffset of its location is '{offset}', not two numbers" in line


def test_a_net_with_a_lane_of_no_width(tmp_path: Path) -> None:
    net = (shipped("sumo_nets") / "us101" / "us101.net.xml").read_text()
    (tmp_path / "my.net.xml").write_text(re.sub('(?<=id="weave_0")(.*)width="3.82"', r'\1width="-0.0"', net))
    line = refused("ramp", "describe", "my.net.xml", cwd=tmp_path)
    assert "my.net.xml: no ramp is written, since it would not pass ramp check: " in line
    assert "lane weave_0" in line
    line = refused("ramp", "new", "mine", "--from-net", "my.net.xml", cwd=tmp_path)
    assert "my.net.xml: lane weave_0 is -0 m wide; mend its 'width'" in line


def test_a_net_without_a_junction(tmp_path: Path) -> None:
    net = (shipped("sumo_nets") / "us101" / "us101.net.xml").read_text().splitlines()
    (tmp_path / "my.net.xml").write_text("\n".join(line for line in net if '<junction id="main_end"' not in line))
    line = refused("ramp", "describe", "my.net.xml", cwd=tmp_path)
    assert "my.net.xml: not a whole SUMO net: it has no junction 'main_end', which an edge names" in line


def test_an_edge_without_junctions(tmp_path: Path) -> None:
    net = (shipped("sumo_nets") / "us101" / "us101.net.xml").read_text()
    (tmp_path / "my.net.xml").write_text(net.replace('id=":lane_end_1" function="internal"', 'id=":lane_end_1"'))
    line = refused("ramp", "describe", "my.net.xml", cwd=tmp_path)
    assert "my.net.xml: not a SUMO net: edge ':lane_end_1' is not internal, but names no junctions" in line


def test_a_car_too_fast_to_be_one(tmp_path: Path) -> None:
    shutil.copytree(shipped("sumo_nets") / "designed", tmp_path, dirs_exist_ok=True)
    (tmp_path / "my.rou.xml").write_text(ROUTES.replace('departSpeed="18"', 'departSpeed="1e20"'))
    (tmp_path / "my.sumocfg").write_text(CONFIG)
    line = refused("run", "my.sumocfg", "--case", "h0_m0", "--method", "acc", cwd=tmp_path)
    assert "my.rou.xml:6: vehicle 'm0': departSpeed is 1e20; it must be at most 100" in line
    (tmp_path / "s.toml").write_text(GRID.replace("to = 25, step = 10", "to = 1e20, step = 1e20"))
    line = refused("run", "s.toml", "--case", "x", "--method", "acc", cwd=tmp_path)
    assert "a speed must be at most 100 m/s" in line


@pytest.mark.parametrize(
    ("stands", "written", "fault"),
    [
        ('id="ramp_0" index="0"', 'id="ramp_0" index="3"', "the lanes of edge 'ramp' are not numbered 0, 1, ..."),
        ("<location ", "<place ", "it has no <location>"),
        ("-500.00,-43.58,1500.00,0.00", "-500.00,1500.00", "not enough values to unpack"),
        ('<lane id="ramp_0"', '<lane id="main_in_0"', "SUMO cannot read it: Error"),
    ],
)
def test_a_net_that_sumo_cannot_bear(tmp_path: Path, stands: str, written: str, fault: str) -> None:
    shutil.copytree(shipped("sumo_nets") / "designed", tmp_path, dirs_exist_ok=True)
    net = tmp_path / "designed.net.xml"
    text = net.read_text()
    assert stands in text
    net.write_text(text.replace(stands, written, 1))
    with pytest.raises(UserError, match=rf"designed\.net\.xml: .*{re.escape(fault)}"):
        tile_net(Ramp.load(tmp_path), 2)


@pytest.mark.parametrize(
    ("stands", "written"), [("to = 4, step = 4", "to = 1e20, step = 4"), ("step = 4", "step = 1e-300")]
)
def test_a_grid_without_an_end(tmp_path: Path, stands: str, written: str) -> None:
    (tmp_path / "s.toml").write_text(GRID.replace(stands, written))
    line = refused("run", "s.toml", "--case", "x", "--method", "acc", cwd=tmp_path)
    assert "s.toml: encounters: a grid of more than 10,000,000 cases; take longer steps" in line


def test_a_seed_or_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(GRID)
    for words in (("sweep", "s.toml"), ("verify", "out"), ("train",), ("reproduce",)):
        for seed in ("-1", str(2**31)):
            assert "Invalid value for '--seed'" in refused(*words, "--seed", seed, cwd=tmp_path)
    for command in (("sweep", "s.toml"), ("ngsim", "surrogate"), ("reproduce",)):  # before anything is simulated
        assert "s.toml: is a file; --out names a folder" in refused(*command, "--out", "s.toml", cwd=tmp_path)

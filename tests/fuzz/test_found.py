"""What the long run has found: each damaged input once more, with the line that it gets."""

import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from command import refused
from fuzz_inputs import CONFIG, ROUTES, trajectories

from merge_cosim.core.files import shipped


def test_a_short_row_with_bytes_that_are_no_text(tmp_path: Path) -> None:
    lines = trajectories(",", True).splitlines()
    lines[8] = b"2,\xde\xff,3"
    (tmp_path / "t.csv").write_bytes(b"\n".join(lines) + b"\n")
    assert "t.csv, from line 2 on: CSV parse error" in refused("ngsim", "summary", "t.csv", cwd=tmp_path)


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
    pq.write_table(table.append_column("smoothed", pa.array([[True]] * len(table))), tmp_path / "t.parquet")
    assert "t.parquet: its columns cannot be taken as trajectories" in refused(*command, cwd=tmp_path)


def test_a_net_whose_path_has_no_connection(tmp_path: Path) -> None:
    shutil.copytree(shipped("sumo_nets") / "designed", tmp_path, dirs_exist_ok=True)
    net = tmp_path / "designed.net.xml"
    kept = [line for line in net.read_text().splitlines() if '<connection from="ramp"' not in line]
    net.write_text("\n".join(kept))
    (tmp_path / "my.rou.xml").write_text(ROUTES)
    (tmp_path / "my.sumocfg").write_text(CONFIG)
    line = refused("run", "my.sumocfg", "--case", "h0_m0", "--method", "acc", cwd=tmp_path)
    assert "SUMO cannot drive the ramp's paths: Vehicle 't0.merging' has no valid route" in line

import gzip
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from ngsim_files import HEADER, ORIGIN, car, write_csv, write_portal, write_text

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim import blocks
from merge_cosim.ngsim.read import merge, read_file
from merge_cosim.ngsim.sites import site
from merge_cosim.ngsim.table import Repeats

US101, I80 = site("us101"), site("i80")

ROWS = car(1, range(10, 16)) + car(1002, range(12, 15), lane=6, y=600.0)


def us101(path, **options):
    return read_file(path, **options).tables["us101"]


def refused(path):
    with pytest.raises(UserError) as caught:
        read_file(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value).removeprefix(str(path))


def test_units_and_values(tmp_path):
    table = us101(write_text(tmp_path / "a.txt", ROWS))
    first = table.slice(6, 1).to_pylist()[0]
    assert first == pytest.approx(
        {
            "site": "us101",
            "recording": "2005-06-15T0750",
            "vehicle_id": 1002,
            "part": 1,
            "frame": 12,
            "x": 52.25 * 0.3048,
            "y": 600 * 0.3048,
            "speed": 12.192,
            "length": 4.7244,
            "width": 1.8288,
            "lane": 6,
            "smoothed": False,
        }
    )


def test_every_format_gives_the_same_table(tmp_path):
    text = write_text(tmp_path / "a.txt", ROWS)
    expected = us101(text)
    assert expected.num_rows == len(ROWS)
    (tmp_path / "a.gz").write_bytes(gzip.compress(text.read_bytes()))
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(text, "inner/a.txt")
        archive.writestr("readme.txt", "Hello\n")
    commas = tmp_path / "commas.txt"
    commas.write_text("\n".join(",".join(line.split()) for line in text.read_text().splitlines()))
    pq.write_table(pa.csv.read_csv(write_csv(tmp_path / "a.csv", ROWS)), tmp_path / "ngsim.parquet")
    pq.write_table(expected, tmp_path / "own.parquet")
    write_portal(tmp_path / "portal.csv", [("us-101", row) for row in reversed(ROWS)])
    for name in ("a.csv", "a.gz", "a.zip", "commas.txt", "ngsim.parquet", "own.parquet", "portal.csv"):
        assert us101(tmp_path / name).equals(expected), name


def test_portal_quirks(tmp_path):
    later = car(1, range(30, 32), origin=ORIGIN["us-101"] + 890_000)
    rows = [("us-101", row) for row in [*ROWS, *later, ROWS[0]]]
    rows += [("i-80", row) for row in car(1, range(2), location="i-80")]
    rows += [("lankershim", row | {"Lane_ID": 101, "Local_Y": -9e9}) for row in car(1, range(3))]
    reading = read_file(write_portal(tmp_path / "a.csv", rows))
    assert reading.rows == len(rows)
    assert reading.elsewhere == {"lankershim": 3}
    assert reading.repeats == Repeats(dropped=1)
    assert {name: table.num_rows for name, table in reading.tables.items()} == {"us101": len(ROWS) + 2, "i80": 2}
    first = reading.tables["us101"].filter(np.equal(reading.tables["us101"]["vehicle_id"].to_numpy(), 1))
    assert first["recording"].unique().to_pylist() == ["2005-06-15T0750", "2005-06-15T0804"]


def test_block_borders_change_nothing(tmp_path, monkeypatch):
    path = write_portal(tmp_path / "a.csv", [("us-101", row) for row in car(1, range(2000), y=0.0)[:700]])
    expected = us101(path)
    monkeypatch.setattr(blocks, "BLOCK_BYTES", 1000)
    assert us101(path).equals(expected)
    bad = path.read_text(encoding="utf-8-sig").splitlines()
    bad[600] = bad[600].replace("52.25", "?")
    path.write_text("\n".join(bad))
    assert refused(path) == ", line 601: Local_X is '?', not a number: mend or remove the row"


def test_a_text_of_another_place_has_no_known_site(tmp_path):
    rows = [row | {"Global_X": 0.0} for row in ROWS]
    reading = read_file(write_text(tmp_path / "a.txt", rows))
    assert reading.tables == {}
    assert reading.elsewhere == {"outside all study areas": len(rows)}
    assert read_file(write_text(tmp_path / "b.txt", car(1, range(2), location="i-80"))).tables.keys() == {"i80"}


@pytest.mark.parametrize(
    ("column", "inside", "outside"),
    [
        ("Global_X", 6_450_700, 6_450_699),
        ("Global_X", 6_453_200, 6_453_201),
        ("Global_Y", 1_871_450, 1_871_449),
        ("Global_Y", 1_873_750, 1_873_751),
    ],
)
def test_a_study_area_ends_at_each_of_its_sides(tmp_path, column, inside, outside):
    def at(place):
        return read_file(write_text(tmp_path / "a.txt", [row | {column: place} for row in ROWS]))

    assert at(inside).tables.keys() == {"us101"}
    assert at(outside).elsewhere == {"outside all study areas": len(ROWS)}


def test_the_site_can_be_given_where_the_file_does_not_tell_it(tmp_path):
    columns = [name for name in HEADER if not name.startswith("Global_") or name == "Global_Time"]
    path = write_csv(tmp_path / "a.csv", ROWS, columns)
    assert "name it with 'merge-cosim ngsim import --site'" in refused(path)
    assert read_file(path, I80).tables.keys() == {"i80"}
    assert us101(path, assumed=US101).num_rows == len(ROWS)


def test_missing_lengths_are_nan(tmp_path):
    path = tmp_path / "a.csv"
    rows = [ROWS[0] | {"v_Length": ""}, ROWS[1] | {"v_Length": 0}, ROWS[2]]
    assert np.isnan(us101(write_csv(path, rows))["length"].to_numpy()).tolist() == [True, True, False]
    without = us101(write_csv(path, ROWS, [name for name in HEADER if name != "v_Length"]))
    assert np.isnan(without["length"].to_numpy()).all()


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("Local_Y", "abc", "Local_Y is 'abc', not a number"),
        ("Local_Y", "NaN", "Local_Y is 'NaN', not a number"),
        ("v_Vel", "", "v_Vel is '', not a number"),
        ("v_Vel", "12,5", "19 columns instead of 18"),
        ("v_Vel", '"12,5"', "v_Vel is '12,5', not a number"),
        ("Local_X", "inf", "Local_X is 'inf', not a number"),
        ("Frame_ID", "1.5", "Frame_ID is '1.5', not a whole number"),
        ("Local_Y", "99999", "Local_Y is '99999', impossible: outside -328.084 to 3280.84"),
        ("Local_X", "-164.1", "Local_X is '-164.1', impossible: outside -164.042 to 328.084"),
        ("Lane_ID", "-1", "Lane_ID is '-1', impossible: outside 0 to 20"),
        ("Global_Time", "never", "Global_Time is 'never', not a number"),
    ],
)
def test_a_bad_cell_is_named_with_its_line(tmp_path, column, value, message):
    path = write_csv(tmp_path / "a.csv", [ROWS[0], ROWS[1] | {column: value}, ROWS[2]])
    assert refused(path).startswith(f", line 3: {message}")


def test_a_bad_cell_in_parquet_is_named_with_its_row(tmp_path):
    path = tmp_path / "a.parquet"
    table = pa.csv.read_csv(write_csv(tmp_path / "a.csv", ROWS))
    pq.write_table(table.set_column(5, "Local_Y", pa.array([1.0, float("nan"), *[2.0] * 7])), path)
    assert refused(path).startswith(", row 2: Local_Y is nan, not a number")
    pq.write_table(table.set_column(5, "Local_Y", pa.array([[1.0]] * 9)), path)
    assert "Local_Y holds list<" in refused(path)


def test_a_missing_column_is_named_with_those_found(tmp_path):
    path = write_csv(tmp_path / "a.csv", ROWS, [name for name in HEADER if name != "Lane_ID"])
    assert refused(path).startswith(": no column Lane_ID; the columns are Vehicle_ID, Frame_ID")
    path = write_csv(tmp_path / "b.csv", ROWS, [name for name in HEADER if name != "Global_Time"])
    assert refused(path).startswith(": no column Global_Time;")


def test_two_columns_of_one_name_are_refused_where_the_column_is_needed(tmp_path):
    path = write_csv(tmp_path / "a.csv", ROWS, [*HEADER, "Lane_ID", "Local_Y"])
    path.write_text(path.read_text().replace(",Lane_ID,Local_Y\n", ",LANE_ID,local_y\n"))
    assert refused(path).startswith(": two columns are called Local_Y; remove one")
    path.write_text(path.read_text().replace(",LANE_ID,local_y\n", ",LANE_ID,v_acc\n"))
    assert refused(path).startswith(": two columns are called Lane_ID; remove one")
    path.write_text(path.read_text().replace(",LANE_ID,v_acc\n", ",more,v_acc\n"))
    assert len(us101(path)) == len(ROWS)


@pytest.mark.parametrize("write", [write_text, write_csv])
def test_a_file_cut_short_is_named_with_its_line(tmp_path, write):
    path = write(tmp_path / "a", ROWS)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:-1], lines[-1][:40]]))
    message = refused(path)
    assert message.startswith(f", line {len(lines)}: ")
    assert "cut short" in message


def test_packed_files_cut_short(tmp_path):
    text = write_text(tmp_path / "a.txt", car(1, range(3000), y=-300.0)[:700]).read_bytes()
    path = tmp_path / "a"
    path.write_bytes(gzip.compress(text)[:-300])
    assert "damaged or cut short" in refused(path)
    pq.write_table(us101(tmp_path / "a.txt"), path)
    path.write_bytes(path.read_bytes()[:-50])
    assert "damaged or cut short" in refused(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(tmp_path / "a.txt", "a.txt")
    path.write_bytes(path.read_bytes()[:-50])
    assert "damaged or cut short" in refused(path)


def test_a_rounded_clock_is_refused(tmp_path):
    rows = [row | {"Global_Time": 1_118_847_000_000} for row in car(1, range(900), y=0.0)[:800]]
    assert "does not advance by 100 ms" in refused(write_csv(tmp_path / "a.csv", rows))


@pytest.mark.parametrize("origin", [-5_000, -5_000_000_000_000, 5_000_000_000_000])
def test_a_clock_outside_the_years_is_refused(tmp_path, origin):
    assert "does not advance by 100 ms" in refused(write_csv(tmp_path / "a.csv", car(1, range(3), origin=origin)))


def test_merging_keeps_common_rows_once(tmp_path):
    one = read_file(write_text(tmp_path / "a.txt", ROWS[:6]))
    two = read_file(write_portal(tmp_path / "b.csv", [("us-101", row) for row in ROWS[3:]]))
    both = merge([one, two])
    assert both.tables["us101"].equals(us101(write_csv(tmp_path / "c.csv", ROWS)))
    assert both.repeats.dropped == 3


def test_real_fragments(data_dir):
    table = us101(data_dir / "us101.parquet")
    assert table.num_rows == 98_732
    assert len(table["recording"].unique()) == 11
    assert np.sum(table["smoothed"].to_numpy()) == 38_398
    assert pa.compute.min_max(table["part"]).as_py() == {"min": 1, "max": 4}

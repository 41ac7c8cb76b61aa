import gzip
import zipfile

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ngsim_files import car, write_csv, write_portal, write_text

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.formats import NGSIM, OWN, Kind, Layout, missing_columns, sources
from merge_cosim.ngsim.table import SCHEMA

CAR = car(1, range(3))


def kind(path):
    return sources(path)[0].kind


def test_files_are_recognised_by_content_not_by_name(tmp_path):
    for source in (
        sources(write_text(tmp_path / "a.parquet", CAR))[0],
        sources(write_csv(tmp_path / "b.txt", CAR))[0],
        sources(write_portal(tmp_path / "c", [("us-101", row) for row in CAR]))[0],
    ):
        assert source.kind is Kind.TRAJECTORIES
        assert source.layout is NGSIM


def test_own_parquet(tmp_path):
    pq.write_table(SCHEMA.empty_table(), tmp_path / "a.csv")
    (source,) = sources(tmp_path / "a.csv")
    assert (source.kind, source.layout, source.parquet) == (Kind.TRAJECTORIES, OWN, True)


def test_column_names_are_found_in_any_case(tmp_path):
    (source,) = sources(write_portal(tmp_path / "a.csv", [("us-101", CAR[0])]))
    assert source.find("v_Length") == "v_length"
    assert source.find("nothing") is None


def test_zip_and_gzip(tmp_path):
    text = write_text(tmp_path / "a.txt", CAR)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(text, "inner/a.txt")
        archive.writestr("readme.txt", "Hello\n")
    (tmp_path / "a.gz").write_bytes(gzip.compress(text.read_bytes()))
    assert [source.kind for source in sources(tmp_path / "a.zip")] == [Kind.TRAJECTORIES, Kind.OTHER]
    assert kind(tmp_path / "a.gz") is Kind.TRAJECTORIES


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (b"", "it is empty"),
        (b"\n", "has 0 columns and no header"),
        (b"1 2 3\n", "has 3 columns and no header"),
        (b"# Notes\n", "none of the columns"),
        (b"\x00\x01\x02\xff", "not a text"),
        (b"Vehicle_ID,Frame_ID,Local_X\n1,2,3\n", "lacks the columns Local_Y, v_Vel, Lane_ID"),
    ],
)
def test_what_is_not_trajectory_data_is_noted(tmp_path, content, note):
    (tmp_path / "a").write_bytes(content)
    (source,) = sources(tmp_path / "a")
    assert source.kind is Kind.OTHER
    assert note in source.note


@pytest.mark.parametrize(
    ("columns", "is_meant"),
    [
        ("Vehicle_ID,Frame_ID,Local_X,Local_Y,v_Vel,Lane_ID", True),
        ("Vehicle_ID,Frame_ID,Local_X,Local_Y,v_Vel", True),
        ("Vehicle_ID,Frame_ID,Local_X,Local_Y", True),
        ("Vehicle_ID,Frame_ID,Local_X", False),
    ],
)
def test_a_file_that_lacks_two_columns_is_meant_to_be_ngsims(tmp_path, columns, is_meant):
    (tmp_path / "a.csv").write_text(f"{columns}\n")
    (source,) = sources(tmp_path / "a.csv")
    assert (source.kind is Kind.TRAJECTORIES) == is_meant
    assert len(missing_columns(source, NGSIM)) == 6 - len(columns.split(","))


def test_a_layout_is_as_plain_as_can_be_unless_it_says_otherwise():
    plain = Layout({"x": "X", "part": "P"}, "", 1.0, {})
    assert plain.required == ["X"]
    assert (plain.rate, plain.skip_first, plain.to_front, plain.default_length) == (10.0, 0, 0.0, 5.0)
    assert not plain.of_site
    assert not plain.smoothed


def test_a_missing_file(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        sources(tmp_path / "nothing.csv")


@pytest.mark.parametrize("magic", [b"PK\x03\x04", b"PAR1", b"\x1f\x8b\x08\x00"])
def test_damaged_archives_are_named(tmp_path, magic):
    (tmp_path / "a").write_bytes(magic + bytes(20))
    with pytest.raises(UserError, match="damaged or cut short"):
        sources(tmp_path / "a")


def test_real_files(data_dir):
    assert kind(data_dir / "us101.parquet") is Kind.TRAJECTORIES
    assert kind(data_dir / "i80.parquet") is Kind.NO_CLOCK
    assert kind(data_dir / "us101_merging_episodes.parquet") is Kind.EPISODES
    assert kind(data_dir / "us101_merge_events.csv") is Kind.OTHER


def test_unrelated_parquet(tmp_path):
    pq.write_table(pa.table({"a": [1]}), tmp_path / "a")
    assert kind(tmp_path / "a") is Kind.OTHER

import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command import merge_cosim, refused
from ngsim_files import car, write_csv, write_portal

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.convert import Recording, convert
from merge_cosim.ngsim.data import load_trajectories
from merge_cosim.ngsim.sites import site

US101, I80 = site("us101"), site("i80")


@pytest.fixture
def portal(tmp_path):
    rows = [("us-101", row) for row in car(1, range(5)) + car(2, range(3))]
    rows += [("i-80", row) for row in car(7, range(4), location="i-80")] + [("lankershim", rows[0][1])]
    return write_portal(tmp_path / "rows.csv", rows)


def test_one_file_per_site(portal, tmp_path):
    done = convert([portal], tmp_path / "out")
    assert done.recordings == [
        Recording("i80", "2005-04-13T1559", 4, 1),
        Recording("us101", "2005-06-15T0750", 8, 2),
    ]
    assert (done.rows, done.kept, done.elsewhere) == (13, 12, {"lankershim": 1})
    assert load_trajectories(tmp_path / "out", US101).num_rows == 8
    assert load_trajectories(done.written["i80"], I80).num_rows == 4


def test_one_site_of_several_files(portal, tmp_path):
    more = write_csv(tmp_path / "more.csv", car(2, range(2, 6)))
    done = convert([portal, more], tmp_path / "out", US101)
    assert list(done.written) == ["us101"]
    assert (done.kept, done.repeats.dropped, done.elsewhere) == (11, 1, {"lankershim": 1, "i80": 4})
    with pytest.raises(UserError, match=r"more\.csv: no row of i80"):
        convert([portal, more], tmp_path / "out", I80)


def test_a_file_is_not_overwritten_by_itself(portal, tmp_path):
    done = convert([portal], tmp_path / "out")
    with pytest.raises(UserError, match="would be overwritten"):
        convert([done.written["us101"]], tmp_path / "out")


@pytest.mark.parametrize("name", ["a/b", "../b"])
def test_a_site_that_is_no_name_for_a_file(portal, tmp_path, name):
    table = pq.read_table(convert([portal], tmp_path / "out").written["us101"])
    column = pa.array([name] * len(table)).dictionary_encode()
    pq.write_table(table.set_column(0, table.schema.field("site"), column), tmp_path / "own.parquet")
    with pytest.raises(UserError, match="no name for a file"):
        convert([tmp_path / "own.parquet"], tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_rows_of_other_sites_as_json_and_the_summary_of_what_was_written(portal, tmp_path):
    done = merge_cosim("ngsim", "import", portal, "--out", "out", "--json", cwd=tmp_path)
    written = json.loads(done.stdout)
    assert written["elsewhere"] == {"lankershim": 1}
    for name, file in written["written"].items():
        (summary,) = json.loads(merge_cosim("ngsim", "summary", file, "--json", cwd=tmp_path).stdout)
        assert (summary["site"], summary["pairs"]) == (name, 0)
    assert "no row of i80 (it has us101)" in refused(
        "ngsim", "summary", written["written"]["us101"], "--site", "i80", cwd=tmp_path
    )

import os

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from ngsim_files import car, write_csv, write_portal, write_text

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.data import cached, data_files, episode_files, find_data, load_trajectories
from merge_cosim.ngsim.formats import Kind
from merge_cosim.ngsim.read import read_file

EPISODES = pa.table({name: [1.0] for name in ("episode", "frame", "car", "station_m", "speed_m_s", "accel_m_s2")})


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "data"
    (folder / "inner").mkdir(parents=True)
    write_text(folder / "inner" / "a.txt", car(1, range(5)))
    write_csv(folder / "b.csv", car(2, range(4)))
    pq.write_table(EPISODES, folder / "e.parquet")
    (folder / "README.md").write_text("# Notes\n")
    (folder / "rows.csv.part").write_text("Vehicle_ID")
    (folder / ".hidden").write_text("")
    return folder


def test_what_a_folder_holds(folder):
    kinds = {file.path.name: file.kind for file in data_files(folder)}
    assert kinds == {
        "README.md": Kind.OTHER,
        "a.txt": Kind.TRAJECTORIES,
        "b.csv": Kind.TRAJECTORIES,
        "e.parquet": Kind.EPISODES,
        "rows.csv.part": Kind.OTHER,
    }
    assert all(file.note for file in data_files(folder) if file.kind is Kind.OTHER)
    assert episode_files(folder) == [folder / "e.parquet"]


def test_a_folder_gives_the_rows_of_all_its_files(folder):
    table = load_trajectories(folder, "us101")
    assert table["vehicle_id"].to_pylist() == [1] * 5 + [2] * 4
    assert load_trajectories(folder, "i80") is None


def test_named_files_must_hold_the_site(folder):
    assert load_trajectories(folder / "b.csv", "us101").num_rows == 4
    assert load_trajectories(folder / "e.parquet", "us101") is None
    with pytest.raises(UserError, match="no row of i80 \\(it has us101\\)"):
        load_trajectories([folder / "b.csv"], "i80")
    with pytest.raises(UserError, match="not trajectory data"):
        load_trajectories([folder / "README.md"], "us101")
    with pytest.raises(UserError, match="no such file"):
        load_trajectories(folder / "nothing", "us101")


def test_the_cache_gives_the_same_and_notices_a_changed_file(tmp_path):
    rows = [("us-101", row) for row in car(1, range(5))] * 2 + [("peachtree", row) for row in car(1, range(2))]
    path = write_portal(tmp_path / "a.csv", rows)
    fresh, stored, again = read_file(path), cached(path), cached(path)
    assert stored == fresh
    assert again == fresh
    write_portal(path, rows[:3])
    os.utime(path, ns=(0, 0))
    assert cached(path).rows == 3


def test_where_data_are_looked_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("MERGE_COSIM_DATA", raising=False)
    assert find_data(None) is None
    (tmp_path / "data").mkdir()
    assert find_data(None) is None  # an empty folder holds no data
    (tmp_path / "data" / "trajectories.csv").touch()
    assert find_data(None).resolve() == tmp_path / "data"
    monkeypatch.setenv("MERGE_COSIM_DATA", str(tmp_path))
    assert find_data(None) == tmp_path
    assert find_data(tmp_path / "data") == tmp_path / "data"
    with pytest.raises(UserError, match="no such folder \\(from --data\\)"):
        find_data(tmp_path / "nothing")
    monkeypatch.setenv("MERGE_COSIM_DATA", "nothing")
    with pytest.raises(UserError, match="from \\$MERGE_COSIM_DATA"):
        find_data(None)


def test_real_data(data_dir):
    table = load_trajectories(data_dir, "us101")
    assert table.num_rows == 98_732
    assert load_trajectories(data_dir, "i80") is None
    assert data_dir / "us101_merging_episodes.parquet" in episode_files(data_dir)
    with pytest.raises(UserError, match="no common clock"):
        load_trajectories([data_dir / "i80.parquet"], "i80")

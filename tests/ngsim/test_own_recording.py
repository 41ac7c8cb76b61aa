"""A recording of any site, in columns of its own: from its file to encounters, and the commands of the page."""

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command import merge_cosim, refused, summary

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.core.units import FOOT
from merge_cosim.ngsim.data import load_trajectories
from merge_cosim.ngsim.pairing.encounters import site_encounters
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.read import read_file
from merge_cosim.ngsim.sites import Site, site
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.worlds.logged_traffic import logged_road

DOCS = Path(__file__).parents[2] / "docs"
EXAMPLE = DOCS / "files" / "mona-merge"

SITE = """
title = "A merge in feet"
[lanes]
host = [1]
ramp = [2]
[recording]
format = "columns"
unit = "ft"
rate = 5.0
point = "centre"
gore = -50.0
[recording.columns]
vehicle_id = "car"
time = "t"
y = "s"
speed = "v"
lane = "lane"
length = "len"
recording = "film"
"""


@pytest.fixture
def own(tmp_path: Path) -> Site:
    (tmp_path / "merge").mkdir()
    (tmp_path / "merge" / "site.toml").write_text(SITE)
    return site(tmp_path / "merge")


def write(path: Path, **changed: list[object]) -> Path:
    """A host of 40 ft/s and, 60 ft behind, a car that merges after 6 s: 8 s at 5 Hz, one length missing."""
    time = np.arange(41) / 5
    columns = {
        "car": [7] * 41 + [8] * 41,
        "t": [*time, *time],
        "s": [*(40 * time), *(40 * time - 60)],
        "v": [40.0] * 82,
        "lane": [1] * 41 + [2] * 30 + [1] * 11,
        "len": [16.0] * 41 + [None] * 41,
        "film": ["a"] * 82,
    }
    pq.write_table(pa.table(columns | changed), path)
    return path


def test_columns_units_rate_and_point(tmp_path: Path, own: Site) -> None:
    table = read_file(write(tmp_path / "a.parquet"), own).tables["merge"]
    assert table["frame"].to_pylist() == [*range(81), *range(81)]
    assert table["recording"].unique().to_pylist() == ["a"]
    np.testing.assert_allclose(table["speed"].to_numpy(), 40 * FOOT)
    host, merging = table["y"].to_numpy()[:81], table["y"].to_numpy()[81:]
    np.testing.assert_allclose(host, 8 * FOOT + 4 * FOOT * np.arange(81), atol=1e-9)  # 8 ft from centre to front
    np.testing.assert_allclose(merging - host, 2.5 - 68 * FOOT, atol=1e-9)  # the default length is 5 m


def test_the_original_and_the_imported_file_give_the_same_encounters(tmp_path: Path, own: Site) -> None:
    (tmp_path / "raw").mkdir()
    write(tmp_path / "raw" / "a.parquet")
    done = merge_cosim("ngsim", "import", "raw/a.parquet", "--site", "merge", "--out", "made", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    raw, made = (site_encounters(tmp_path / name, own) for name in ("raw", "made"))
    assert raw is not None
    assert made is not None
    assert raw.digest == made.digest
    assert (raw.site.tolist(), raw.source.tolist(), raw.car.tolist()) == (["merge"], ["recorded"], ["merge/a/8/1"])
    np.testing.assert_allclose(raw.merge_position, 2.5 + (240 - 60 + 50) * FOOT, atol=1e-6)
    strict = site_encounters(tmp_path / "raw", own, PairRules(min_window=6.1))
    assert strict is not None
    assert len(strict) == 0


def test_a_file_without_a_recording_is_one(tmp_path: Path) -> None:
    (tmp_path / "merge").mkdir()
    (tmp_path / "merge" / "site.toml").write_text(SITE.replace('recording = "film"\n', ""))
    table = read_file(write(tmp_path / "one.parquet"), site(tmp_path / "merge")).tables["merge"]
    assert table["recording"].to_pylist() == ["one"] * 162


def test_mistakes_in_the_recording_are_named(tmp_path: Path, own: Site) -> None:
    with pytest.raises(UserError, match=r"a\.parquet, row 2: v is -9\.0, impossible: outside -3\.28084 to 328\.084"):
        read_file(write(tmp_path / "a.parquet", v=[40.0, -9.0, *[40.0] * 80]), own)
    pq.write_table(pq.read_table(write(tmp_path / "a.parquet")).drop_columns(["len"]), tmp_path / "a.parquet")
    with pytest.raises(UserError, match=r"a\.parquet: no column len; the columns are car, t, s, v, lane, film"):
        read_file(tmp_path / "a.parquet", own)
    pq.write_table(pa.table({"a": [1]}), tmp_path / "b.parquet")
    with pytest.raises(UserError, match="it has none of the columns of the site"):
        load_trajectories(tmp_path / "b.parquet", own)


def test_there_is_no_surrogate_of_it(tmp_path: Path, own: Site) -> None:
    scenario = tmp_path / "own.toml"
    scenario.write_text((EXAMPLE / "mona-replay.toml").read_text().replace("ramps/mona-merge", "merge"))
    line = refused("sweep", "own.toml", "--method", "acc", "--out", "out", cwd=tmp_path)
    assert "site merge: there is no surrogate of it (only of us101 and i80); give its data with --data DIR" in line
    scenario.write_text(scenario.read_text().replace('sites = { "merge"', 'sites = { "nowhere"'))
    line = refused("sweep", "own.toml", "--method", "acc", "--out", "out", cwd=tmp_path)
    assert "unknown site 'nowhere': choose i80, us101, or a folder with site.toml" in line


def test_full_scenes_find_the_site_of_a_ramp_by_its_folder(tmp_path: Path) -> None:
    shutil.copytree(shipped("sumo_nets") / "us101", tmp_path / "copy")
    copied, ours = (logged_road(Ramp.load(name)) for name in (tmp_path / "copy", "us101"))
    assert copied.strips == ours.strips
    (tmp_path / "copy" / "site.toml").unlink()
    with pytest.raises(UserError, match=r"copy/site\.toml: cannot be read"):
        logged_road(Ramp.load(tmp_path / "copy"))


def test_the_commands_of_the_page(tmp_path: Path, mona_dir: Path) -> None:
    for file in (*EXAMPLE.iterdir(), mona_dir / "mona_merge_southwest.parquet"):
        shutil.copy(file, tmp_path)
    text = (DOCS / "sites.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    for line in block.splitlines():
        command, *words = shlex.split(line)
        if command == "cp":
            shutil.copy(tmp_path / words[0], tmp_path / words[1])
        else:
            done = merge_cosim(*words, cwd=tmp_path)
            assert done.returncode == 0, done.stderr
    shown = merge_cosim("ngsim", "summary", "data", "--site", "ramps/mona-merge", "--json", cwd=tmp_path)
    (facts,) = json.loads(shown.stdout)
    assert (facts["pairs"], facts["cars"], facts["extended"]) == (35, 21, 35)
    assert facts["rejected"] == {"no_host": 1, "logged_host_fails": 1}
    for method, row in summary(tmp_path / "out").items():
        assert f"| {method} | {row['failures']} of {row['n']} |" in text
        assert f"| {row['distance_m']:.1f} m | {row['delay_s']:.2f} s | {row['hardest_braking']:.2f} m/s² |" in text

"""The surrogate, made by a real SUMO."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from merge_cosim.core.encounter import Intention
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FOOT
from merge_cosim.ngsim.data import load_trajectories
from merge_cosim.ngsim.pairing.encounters import site_pairs
from merge_cosim.ngsim.sites import Site, shipped_sites, site
from merge_cosim.ngsim.surrogate.ngsim_format import ngsim_rows
from merge_cosim.ngsim.surrogate.recipe import RECIPES
from merge_cosim.ngsim.surrogate.sumo_run import COLUMNS, simulate
from merge_cosim.ngsim.surrogate.surrogate import cached_surrogate, export, generate, surrogate_folder
from merge_cosim.ramps.ramp import Ramp, read_net

US101 = site("us101")

SHORT = {name: replace(recipe, seeds=(7, 8), duration=40.0, warm_up=30.0) for name, recipe in RECIPES.items()}
NUMBER_OF_PAIRS = {"us101": 354, "i80": 452}
"""Published sizes (Dong, Dolan, Litkouhi 2017, Table I), from recordings of 45 minutes."""

sites = pytest.mark.parametrize("site", shipped_sites(), ids=lambda site: site.name)


def read(site: Site) -> pa.Table:
    table = load_trajectories(cached_surrogate(SHORT[site.name]), site)
    assert table is not None
    return table


@sites
def test_the_same_recipe_gives_the_same_bytes(site: Site, tmp_path: Path) -> None:
    recipe = SHORT[site.name]
    (cached,) = cached_surrogate(recipe).iterdir()
    generate(recipe, Ramp.load(site.name), tmp_path / "again.parquet")
    assert cached.name == f"{site.name}-surrogate.parquet"
    assert cached.read_bytes() == (tmp_path / "again.parquet").read_bytes()


@sites
def test_the_reader_reads_it_as_raw_data_on_the_filmed_road(site: Site) -> None:
    table = read(site)
    assert set(table["recording"].to_pylist()) == {"surrogate_1", "surrogate_2"}
    assert not table["smoothed"].to_numpy().any()
    y, lane = table["y"].to_numpy(), table["lane"].to_numpy()
    assert y.min() >= 0
    assert y.max() <= site.length
    assert {site.host_lane, *site.ramp_lanes} <= set(lane.tolist())
    filmed_from = site.gore_y + SHORT[site.name].filmed_from
    assert y[np.isin(lane, site.ramp_lanes)].min() >= filmed_from - 1e-3
    assert set(table["frame"].to_pylist()) == set(range(1, 401))


@sites
def test_cars_move_as_fast_as_they_say(site: Site) -> None:
    table = read(site)
    same = np.diff(table["vehicle_id"].to_numpy()) == 0
    same &= np.diff(table["part"].to_numpy()) == 0
    same &= np.diff(table["frame"].to_numpy()) == 1
    moved = np.diff(table["y"].to_numpy())[same] / 0.1
    assert np.abs(moved - table["speed"].to_numpy()[1:][same]).max() < 0.02


@sites
def test_lanes_lie_side_by_side(site: Site) -> None:
    table = read(site)
    x, lane = table["x"].to_numpy(), table["lane"].to_numpy()
    medians = [np.median(x[lane == number]) for number in sorted(set(lane.tolist()))]
    assert np.all(np.diff(medians[: site.host_lane]) > 0)
    assert medians[0] > 0


def test_another_recipe_has_another_place_in_the_cache() -> None:
    short = replace(SHORT["us101"], duration=1.0, warm_up=1.0)
    assert cached_surrogate(short) != cached_surrogate(replace(short, merging=400.0))


def test_a_row_in_feet_by_hand(tmp_path: Path) -> None:
    run = {
        "timestep_time": [30.0, 30.1],
        "vehicle_id": ["merging.0", "merging.0"],
        "vehicle_type": ["drivers-0", "drivers-0"],
        "vehicle_lane": ["weave_0", "weave_1"],
        "vehicle_pos": [10.0, 11.5],
        "vehicle_posLat": [1.0, 0.25],
        "vehicle_speed": [15.0, 15.0],
        "vehicle_acceleration": [0.0, 3.048],
    }
    pq.write_table(pa.table(run), tmp_path / "run.parquet")
    ramp = Ramp.load("us101")
    rows = ngsim_rows(tmp_path / "run.parquet", SHORT["us101"], ramp, US101, 1).to_pylist()
    assert [row["Lane_ID"] for row in rows] == [6, 5]
    assert [row["Frame_ID"] for row in rows] == [1, 2]
    assert rows[0]["Global_Time"] == 3_600_100
    assert rows[1]["Local_Y"] == round((186.84 + 11.5) / FOOT, 3)
    widths = [lane.getWidth() for lane in reversed(read_net(ramp.net).getEdge("weave").getLanes())]
    assert rows[0]["Local_X"] == round((sum(widths[:5]) + widths[5] / 2 - 1.0) / FOOT, 3)
    assert rows[1]["Local_X"] == round((sum(widths[:4]) + widths[4] / 2 - 0.25) / FOOT, 3)
    assert rows[1]["v_Acc"] == 10.0
    assert rows[0]["segment"] == "surrogate_2"


def test_a_run_is_recorded_from_the_warm_up_on(tmp_path: Path) -> None:
    recipe = replace(SHORT["us101"], duration=2.0, warm_up=20.0)
    run = pq.read_table(simulate(recipe, Ramp.load("us101"), 7, 600.0, tmp_path))
    assert {f"vehicle_{name}" for name in COLUMNS} <= set(run.column_names)
    assert sorted(set(run["timestep_time"].to_pylist())) == pytest.approx(20.0 + 0.1 * np.arange(20))


def test_sumo_that_fails_is_reported_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="SUMO fails") as error:
        generate(replace(SHORT["us101"], min_gap=-5.0), Ramp.load("us101"), tmp_path / "x.parquet")
    assert "\n" not in str(error.value)


@sites
def test_there_are_as_many_pairs_as_published_of_both_kinds(site: Site) -> None:
    """In proportion to the time: the tests have one recording of three minutes."""
    recipe = RECIPES[site.name]
    expected = NUMBER_OF_PAIRS[site.name] * len(recipe.seeds) * recipe.duration / 2700
    paired = site_pairs(surrogate_folder(site), site, source="surrogate")
    assert paired is not None
    encounters = paired.encounters
    assert len(encounters) >= expected
    assert 0.35 < np.mean(encounters.label == Intention.YIELD) < 0.65
    assert not encounters.smoothed_source.any()
    assert set(encounters.source) == {"surrogate"}
    assert len(paired.rejected.get("logged_host_fails", ())) <= 2


def test_the_surrogate_is_copied_for_other_programs(tmp_path: Path) -> None:
    copy = export(US101, tmp_path / "out")
    assert copy == tmp_path / "out" / "us101-surrogate.parquet"
    assert copy.read_bytes() == (surrogate_folder(US101) / copy.name).read_bytes()
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="file: is a file; --out names a folder"):
        export(US101, tmp_path / "file")

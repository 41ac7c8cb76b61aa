"""`sweep`: what it takes, where it writes, and what it refuses."""

import pandas as pd
import pytest

import merge_cosim as mc

STATES = {"host_station": [-80.0, -90.0], "host_speed": 20.0, "merging_station": -90.0, "merging_speed": [18.0, 20.0]}


def test_a_temporary_folder_lives_as_long_as_its_results():
    encounters = mc.Encounters.from_frame(pd.DataFrame(STATES))
    results = mc.sweep(encounters, "acc", jobs=1)
    folder = results.path
    assert (folder / "results.parquet").is_file()
    del results
    assert not folder.exists()


def test_a_finished_folder_is_not_run_again(tmp_path):
    encounters = mc.Encounters.from_frame(pd.DataFrame(STATES))
    first = mc.sweep({"mine": encounters}, "acc", jobs=1, out=tmp_path / "out")
    assert first.rows["scenario"].unique().tolist() == ["mine"]
    before = (tmp_path / "out/results.parquet").stat().st_mtime_ns
    again = mc.sweep({"mine": encounters}, "acc", jobs=1, out=tmp_path / "out", resume=True)
    assert (tmp_path / "out/results.parquet").stat().st_mtime_ns == before
    assert again.rows.equals(first.rows)


def test_states_of_a_grid_give_the_rows_of_the_grid(results):
    """The first states of Designed Test II, handed over as numbers."""
    cases = results.rows["case"].unique()[:5]
    named = pd.Series(cases).str.extract(r"d(.*)_h(.*)_m(.*)").astype(float)
    states = {"case": cases, "merging_station": -90.0, "host_station": named[0] - 90, "host_speed": named[1]}
    encounters = mc.Encounters.from_frame(pd.DataFrame(states).assign(merging_speed=named[2]))
    own = mc.sweep([encounters], ["acc", "pgm"], jobs=1).rows
    theirs = results.rows[results.rows["case"].isin(cases)]
    apart = ["scenario", "site"]
    own, theirs = (rows.drop(columns=apart).reset_index(drop=True).convert_dtypes() for rows in (own, theirs))
    pd.testing.assert_frame_equal(own, theirs, check_exact=True)


def test_a_scenario_file_of_states(tmp_path):
    pd.DataFrame(STATES).to_csv(tmp_path / "states.csv", index=False)
    text = 'title = "Mine"\nramp = "designed"\nmerging = { model = "designed" }\n[encounters]\nkind = "table"\n'
    (tmp_path / "mine.toml").write_text(text + f'file = "{tmp_path / "states.csv"}"\n', encoding="utf-8")
    scenario = mc.load_scenario(tmp_path / "mine.toml", {"test.horizon": 20})
    assert len(mc.sweep(scenario, "acc", jobs=1)) == 2


def test_a_parameter_is_varied():
    encounters = mc.Encounters.from_frame(pd.DataFrame(STATES))
    results = mc.sweep([encounters], ["acc"], vary={"acc.headway": [1.0, 1.5]}, jobs=1)
    assert results.rows["variation"].unique().tolist() == ["", "acc.headway=1.0", "acc.headway=1.5"]
    assert len(results.plot.variation("acc.headway").axes) == 1


@pytest.mark.parametrize(
    ("scenarios", "methods", "more", "message"),
    [
        ("designed2", "acc", {}, "did you mean 'designed-2'"),
        ("designed-2", "pmg", {}, "did you mean 'pgm'"),
        ([7], "acc", {}, "7 is no scenario"),
        ({"mine": 7}, "acc", {}, "scenario mine: 7 is neither"),
        ("designed-2", "acc", {"settings": {"acc.headwya": 1}}, "did you mean 'headway'"),
        ("designed-2", "acc", {"data": "/nowhere"}, "no such folder"),
    ],
)
def test_what_does_not_exist_is_refused(scenarios, methods, more, message):
    with pytest.raises(mc.UserError, match=message):
        mc.sweep(scenarios, methods, jobs=1, **more)


def test_two_batches_of_encounters_need_names():
    encounters = mc.Encounters.from_frame(pd.DataFrame(STATES))
    with pytest.raises(mc.UserError, match="need names"):
        mc.sweep([encounters, encounters], "acc", jobs=1)
    assert set(mc.sweep({"a": encounters, "b": encounters}, "acc", jobs=1).rows["scenario"]) == {"a", "b"}

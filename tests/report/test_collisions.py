"""Why SUMO's collision report differs from our geometry: the two kinds, from real runs."""

import pandas as pd

from merge_cosim.report.collisions import collision_table, explained
from merge_cosim.results.contacts import BEFORE_SCORING, ON_THE_LINE, UNEXPLAINED, kinds_of_difference
from merge_cosim.results.store import ResultFolder
from merge_cosim.sweeps.sweep import SweepRequest, sweep

ONE_CASE = {
    "encounters.host_offset": {"from": -3, "to": -3, "step": 1},
    "encounters.host_speed": {"from": 15, "to": 15, "step": 1},
    "encounters.merging_speed": {"from": 15, "to": 15, "step": 1},
}


def test_a_front_exactly_on_the_merging_point_is_ours_only(tmp_path):
    sweep(SweepRequest(["designed-2"], ["always-go"], settings=ONE_CASE), tmp_path)
    rows = ResultFolder(tmp_path).results().to_pandas()
    assert kinds_of_difference(rows).tolist() == [ON_THE_LINE]
    assert collision_table(rows).data.loc[0, ["runs", "both", "ours_only", "side"]].tolist() == [1, 0, 1, 1]


def test_a_contact_before_scoring_is_sumos_only(data_dir, tmp_path):
    replay = {"scenarios": ["us101-replay"], "methods": ["always-yield"], "data": data_dir, "source": "ngsim"}
    sweep(SweepRequest(**replay), tmp_path / "both")
    rows = ResultFolder(tmp_path / "both").results().to_pandas()
    assert set(kinds_of_difference(rows)) == {BEFORE_SCORING}
    sweep(SweepRequest(**replay, settings={"test.overlap_from": "lane_change"}), tmp_path / "lane_change")
    earlier = ResultFolder(tmp_path / "lane_change").results().to_pandas()
    assert kinds_of_difference(earlier).empty
    assert earlier["failed"].sum() == rows["sumo_collision"].sum()


def test_what_fits_neither_kind_is_named():
    row = {
        "scenario": "s",
        "world": "sumo",
        "source": "designed",
        "case": "c",
        "method": "acc",
        "failed": True,
        "failure_kind": "side",
    }
    times = {"host_reached_s": 3.0, "merging_reached_s": 3.2, "end_s": 4.0, "sumo_collision": False}
    rows = pd.DataFrame([row | times])
    assert kinds_of_difference(rows).tolist() == [UNEXPLAINED]
    [(count, _, example)] = explained(rows)
    assert (count, example) == (1, "s c under acc")

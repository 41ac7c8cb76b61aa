import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from trajectory_tables import steady, table
from typer.testing import CliRunner

from merge_cosim.cli.ngsim import app
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT, time_to_arrival
from merge_cosim.ngsim.pairing.pairs import extract_pairs
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.summary import summarise, summarise_folder
from merge_cosim.ngsim.sites import site

US101 = site("us101")

MERGE = [6] * 30 + [5] * 60


def test_the_numbers_of_two_pairs() -> None:
    cars = table(
        steady(1, MERGE, at=0),
        steady(2, [5] * 90, at=-10, speed=15, length=float("nan")),
        steady(3, [5] * 70, at=20, speed=12, frame=10),
    )
    summary = summarise(extract_pairs(cars, US101, PairRules(), "ngsim"), "us101")
    assert (summary.pairs, summary.cars, summary.merging_cars) == (2, 1, 1)
    assert summary.merge_distance_m == pytest.approx((45 + 30) / 2)
    assert summary.speed_m_s == pytest.approx((45 + 45 + 30 + 24) / (3 + 3 + 2 + 2))
    assert summary.yielding == 0.5
    assert summary.window_s == pytest.approx((2.0, 2.5, 3.0))
    assert (summary.complete, summary.cut, summary.extended) == (2, 0, 0)
    assert (summary.length_missing, summary.smoothed_source, summary.host_past_start) == (1, 0, 0)
    assert summary.published is not None
    assert summary.published.pairs == 354


def test_no_pair_has_no_mean() -> None:
    summary = summarise(extract_pairs(table(steady(1, MERGE, at=0)), US101, PairRules(), "ngsim"), "us101")
    assert np.isnan(summary.merge_distance_m)
    assert summary.rejected == {"no_host": 1}
    plain = json.dumps(summary.as_dict(), allow_nan=False)
    assert json.loads(plain)["speed_m_s"] is None


def test_a_folder_without_trajectories(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no trajectories of i80 or us101"):
        summarise_folder(tmp_path)
    with pytest.raises(UserError, match="no such folder"):
        summarise_folder(tmp_path / "nowhere")


def test_the_command(tmp_path: Path) -> None:
    pq.write_table(table(steady(1, MERGE, at=0), steady(2, [5] * 90, at=-10)), tmp_path / "a.parquet")
    run = CliRunner()
    (row,) = json.loads(run.invoke(app, ["summary", str(tmp_path), "--json"], catch_exceptions=False).stdout)
    assert (row["site"], row["pairs"], row["published"]["merge_distance_m"]) == ("us101", 1, 90.4)
    text = run.invoke(app, ["summary", str(tmp_path)], catch_exceptions=False).stdout
    assert "45.0 m" in text
    assert "logged host fails: in no pair" in text


def test_arrival_times_tell_the_real_labels_near_the_merge(data_dir: Path) -> None:
    """The sign of T_m - T_h separates the labels within 40 m; further away it does not quite."""
    from sklearn.metrics import roc_auc_score

    from merge_cosim.ngsim.pairing.encounters import site_encounters

    e = site_encounters(data_dir, US101)
    assert e is not None
    assert e.log is not None
    distance, later, label = [], [], []
    for i in range(len(e)):
        end = e.log.change_cycle[i] + 1
        m, h = e.log.merging_station[i][:end], e.log.host_station[i][:end]
        before = (m < 0) & (h < 0)
        distance.append(-m[before])
        arrivals = (time_to_arrival(s, np.gradient(s, DT)) for s in (h, m))
        later.append(np.subtract(*arrivals)[before])
        label.append(np.full(before.sum(), e.label[i]))
    d, score, truth = np.concatenate(distance), np.concatenate(later), np.concatenate(label)
    near, far = d < 40, (d >= 70) & (d < 110)
    assert roc_auc_score(truth[near], score[near]) > 0.999
    assert roc_auc_score(truth[far], score[far]) == pytest.approx(0.96, abs=0.02)

"""Scores of frames and losses of transitions, by hand and on logs made for the purpose."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from merge_cosim.core.encounter import Encounters, Ragged, ReplayLog
from merge_cosim.estimators.learned.gaussian import WIDE_BINS, SpeedGaussian
from merge_cosim.estimators.learned.histogram import SPEED_BINS, SpeedHistogram
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.slot import SlotTime
from merge_cosim.studies.judging import DENSITIES, Watched, calibration, density_losses, judge, open_loop, score


def watched(log_odds, not_yield, margin=None):
    odds = np.array(log_odds, dtype=float)
    return Watched(odds, np.full(len(odds), 20.0), np.array(margin or odds, dtype=float), np.array(not_yield))


def two_pairs() -> Encounters:
    """Both merging cars are at -30 m, at 10 m/s for ever; the host at -20 m (YIELD) and at -60 m (NOT_YIELD)."""
    cycles = np.arange(31)
    merging, n = -30.0 + 1.0 * cycles, 2
    hosts = [-20.0 + 1.0 * cycles, -60.0 + 1.0 * cycles]
    words = np.array(["a", "b"])
    log = ReplayLog(
        merging_station=Ragged.of([merging, merging]),
        merging_speed=Ragged.of([np.full(31, 10.0), np.full(31, 10.0)]),
        host_station=Ragged.of(hosts),
        change_cycle=np.full(n, 30),
        score_until=np.full(n, 30),
    )
    return Encounters(
        case=words,
        site=np.full(n, "us101"),
        source=np.full(n, "ngsim"),
        car=words,
        host_station=np.array([-20.0, -60.0]),
        host_speed=np.full(n, 10.0),
        host_length=np.full(n, 5.0),
        merging_station=np.full(n, -30.0),
        merging_speed=np.full(n, 10.0),
        merging_length=np.full(n, 5.0),
        merge_position=np.zeros(n),
        label=np.array([0, 1]),
        smoothed_source=np.zeros(n, dtype=bool),
        length_missing=np.zeros(n, dtype=bool),
        log=log,
    )


def test_scores_by_hand():
    got = score(watched([np.log(3), np.log(1 / 4), 0.0, np.log(1 / 9)], [True, True, False, False]))
    assert got["frames"] == 4
    assert got["accuracy_pct"] == 50.0
    assert got["log_loss"] == pytest.approx(-np.log([3 / 4, 1 / 5, 1 / 2, 9 / 10]).mean(), abs=1e-4)
    assert got["brier"] == pytest.approx((0.25**2 + 0.8**2 + 0.5**2 + 0.1**2) / 4, abs=1e-4)
    assert got["auc"] == 0.75  # of the four pairs only (1/4 against 1) is the wrong way round


def test_a_rule_has_accuracy_and_the_auc_of_its_margin():
    got = score(watched([np.inf, -np.inf, -np.inf], [True, False, True], margin=[2.0, -1.0, -0.5]))
    assert got == {"frames": 3, "accuracy_pct": 66.67, "log_loss": None, "auc": 1.0, "brier": None}
    assert calibration(watched([np.inf], [True])) == []


def test_one_intention_alone_has_no_auc():
    assert score(watched([1.0, 2.0], [True, True]))["auc"] is None


def test_calibration_by_hand():
    odds = np.log([1 / 9, 1 / 9, 9, 4])
    rows = calibration(watched(odds, [False, True, True, True]))
    assert [(row["p_from"], row["p_to"], row["frames"]) for row in rows] == [(0.0, 0.2, 2), (0.8, 1.0, 2)]
    assert [row["mean_p"] for row in rows] == [0.1, 0.85]
    assert [row["not_yield_share"] for row in rows] == [0.5, 1.0]


def test_open_loop_ends_where_the_first_car_arrives():
    seen = open_loop(SlotTime(), two_pairs())
    assert len(seen.log_odds) == 20 + 30
    np.testing.assert_array_equal(np.isposinf(seen.log_odds), seen.not_yield)
    assert np.all(seen.margin[~seen.not_yield] == pytest.approx(-1.0))
    assert np.all(seen.margin[seen.not_yield] == pytest.approx(3.0))


def test_every_judged_estimator_has_scores():
    judged = judge(IntentionModel.load("us101-ngsim"), two_pairs())
    by_name = {row["estimator"]: row for row in judged["scores"]}
    assert by_name["slot-time"]["accuracy_pct"] == 100.0
    assert by_name["fg-gmm"]["log_loss"] > 0
    assert sum(row["frames"] for row in judged["calibration"] if row["estimator"] == "fg") == by_name["fg"]["frames"]


def test_losses_of_densities_by_hand():
    model = IntentionModel.load("us101-ngsim")
    counts = np.zeros((2, SPEED_BINS, SPEED_BINS), dtype=np.int64)
    counts[:, 10, 10], counts[:, 10, 11] = 3, 1
    gaussian = SpeedGaussian(np.full((2, WIDE_BINS), 0.1), np.full((2, WIDE_BINS), 0.2))
    model = replace(model, speeds={1: replace(model.speed(1), histogram=SpeedHistogram(counts), gaussian=gaussian)})
    rows = density_losses(model, two_pairs())
    assert [(r["speeds"], r["intention"], r["from_m_s"]) for r in rows[:2]] == [
        ("smoothed", "YIELD", "10-15"),
        ("smoothed", "YIELD", "all"),
    ]
    for row in rows:
        assert row["transitions"] == 29
        assert row["ruled_out"] == 0
        assert row["gaussian"] == pytest.approx(-norm.logpdf(0.0, 0.1, 0.2), abs=1e-4)
        stays = SpeedHistogram(counts).with_background(0.05).probabilities[0, 10, 10]
        assert row["histogram"] == pytest.approx(-np.log(stays), abs=1e-4)
        expected = model.speed(1).mixture.log_density(np.array([10.0]), np.array([10.0]))
        assert row["mixture"] == pytest.approx(-expected[int(row["intention"] == "NOT_YIELD"), 0], abs=1e-4)


def test_what_the_histogram_rules_out_is_counted_apart():
    model = IntentionModel.load("us101-ngsim")
    slow = SpeedHistogram.fit(np.array([1.5, 1.5]), np.array([1.5, 1.5]), np.array([0, 1]))
    model = replace(model, speeds={1: replace(model.speed(1), histogram=slow)})
    for row in density_losses(model, two_pairs()):
        assert row["ruled_out"] == row["transitions"] == 29
        assert all(row[name] is None for name in DENSITIES)

"""Intervals, McNemar's test and scores of beliefs against textbook values and scipy."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit
from scipy.stats import bootstrap
from test_summaries import frame, strata, summarise

from merge_cosim.core.errors import UserError
from merge_cosim.results.statistics import belief, calibration
from merge_cosim.results.statistics.belief import scores
from merge_cosim.results.statistics.comparison import reference_of
from merge_cosim.results.statistics.paired import mean_difference, sign_flip_p
from merge_cosim.results.statistics.rates import Moments, bootstrap_means, percent, wilson


def test_wilson_against_its_formula():
    z, p, n = 1.959963984540054, 10 / 60, 60
    middle, half = p + z * z / (2 * n), z * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5
    low, high = wilson(10, 60)
    assert low == pytest.approx(100 * (middle - half) / (1 + z * z / n), abs=1e-3)
    assert high == pytest.approx(100 * (middle + half) / (1 + z * z / n), abs=1e-3)
    assert wilson(0, 0) == (None, None)


def discordant(one, other, agreeing=5):
    return np.array([1.0] * one + [-1.0] * other + [0.0] * agreeing)


def p_of(one, other):
    differences = discordant(one, other)
    return sign_flip_p(differences, np.arange(len(differences)))


def test_without_clusters_it_is_mcnemars_exact_test():
    assert p_of(6, 16) == pytest.approx(0.0525, abs=5e-5)  # sum of binomials of 22 up to 6, doubled
    assert p_of(0, 5) == pytest.approx(2 * 0.5**5)
    assert p_of(3, 3) == 1.0
    assert p_of(0, 0) == 1.0


@given(st.integers(0, 40), st.integers(0, 40))
def test_the_paired_test_is_symmetric_in_the_two_methods(one, other):
    assert p_of(one, other) == p_of(other, one)
    assert 0.0 < p_of(one, other) <= 1.0


def test_cases_of_one_car_are_kept_together():
    differences = discordant(6, 0)
    assert sign_flip_p(differences, np.arange(11)) == pytest.approx(2 / 2**6)
    assert sign_flip_p(differences, np.array([0, 0, 0, 1, 1, 1, 2, 3, 4, 5, 6])) == pytest.approx(2 / 2**2)
    # sums of 3, 2 and -1: 4 or more in absolute value for 4 of the 8 patterns of signs
    assert sign_flip_p(np.array([1, 1, 1, 1, 1, -1.0]), np.array([0, 0, 0, 1, 1, 2])) == pytest.approx(4 / 8)
    many = np.concatenate([np.full(10, 2.0), np.full(10, 1.0)])
    assert sign_flip_p(np.repeat(many, 1), np.arange(20)) < 1e-3  # drawn, since there are many clusters


def test_mean_difference_and_its_interval():
    first, second = pd.Series([3.0, 4.0, np.nan, 5.0]), pd.Series([1.0, 2.0, 3.0, 3.0])
    mean, (low, high) = mean_difference(first, second, pd.Series(["a", "a", "b", "c"]))
    assert (mean, low, high) == (2.0, 2.0, 2.0)


def test_discordant_cases_are_those_that_both_carry_to_the_end():
    failing = {"this": "abc", "other": "cde"}
    rows = [
        {"case": case, "method": method, "failed": case in failed, "car": case}
        for method, failed in failing.items()
        for case in "abcdefgh"
    ]
    rows[3] |= {"censored": True}  # case d under 'this'
    rows[9] |= {"censored": True}  # case b under 'other'
    summary = summarise(frame(*rows), {}, against="other").set_index("method")
    row = summary.loc["this"]
    assert (row["only_this_fails"], row["only_other_fails"]) == (1, 1)  # a; e
    assert row["mcnemar_p"] == pytest.approx(1.0)
    assert pd.isna(summary.loc["other", "only_this_fails"])
    grid = summarise(frame(*(row | {"source": "designed"} for row in rows)), {}, against="other").set_index("method")
    assert grid.loc["this", "only_other_fails"] == 1
    assert pd.isna(grid.loc["this", "mcnemar_p"])


def test_the_reference_is_the_chosen_one_or_pgm():
    assert reference_of(["acc", "pgm"], None) == "pgm"
    assert reference_of(["acc"], None) is None
    assert reference_of(["acc", "pgm"], "acc") == "acc"
    with pytest.raises(UserError, match="--against slto"):
        reference_of(["acc", "slot"], "slto")


def test_bootstrap_agrees_with_scipy():
    rng = np.random.default_rng(3)
    cars = pd.Series(np.repeat(np.arange(40), 2).astype(str))
    values = pd.DataFrame({"x": np.repeat(rng.normal(20, 5, 40), 2) + rng.normal(0, 1, 80)})
    ((low, high),) = bootstrap_means(values, cars)
    means = values["x"].to_numpy().reshape(40, 2).mean(axis=1)
    theirs = bootstrap((means,), np.mean, method="percentile", n_resamples=5000, rng=rng).confidence_interval
    assert (low, high) == pytest.approx(theirs, abs=0.25)
    ((narrow_low, narrow_high),) = bootstrap_means(values, pd.Series(np.arange(80).astype(str)))
    assert narrow_high - narrow_low < high - low  # cars that agree with themselves count once


def test_bootstrap_covers_the_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(200):
        ((low, high),) = bootstrap_means(pd.DataFrame({"x": rng.exponential(1.0, 60)}), pd.Series(np.arange(60)))
        covered += low <= 1.0 <= high
    assert 0.87 <= covered / 200 <= 0.99


def test_many_clusters_take_the_normal_approximation():
    rng = np.random.default_rng(5)
    few = pd.DataFrame({"x": rng.normal(20, 5, 9_000)})
    many = pd.DataFrame({"x": rng.normal(20, 5, 11_000)})
    for values in (few, many):
        ((low, high),) = bootstrap_means(values, pd.Series(np.arange(len(values))))
        assert (high - low) / 2 == pytest.approx(1.96 * 5 / len(values) ** 0.5, rel=0.1)


def test_the_interval_of_a_ratio_from_its_formula():
    sums, counts = np.array([1.0, 4.0, 2.5, 6.0]), np.array([1, 2, 1, 4])
    ratio = 13.5 / 8
    error = 1.959964 * np.sqrt(4 / 3 * np.sum((sums - ratio * counts) ** 2)) / 8
    assert Moments.of(sums, counts).interval() == pytest.approx((ratio - error, ratio + error))
    parts = (Moments.of(sums[part], counts[part]) for part in (slice(2), slice(2, 4)))
    assert sum(parts, Moments(0, 0.0, 0.0, 0.0, 0.0, 0.0)).interval() == pytest.approx((ratio - error, ratio + error))
    assert Moments.of(sums[:1], counts[:1]).interval() == Moments.of(sums, 0 * counts).interval() == (None, None)


def test_missing_values_do_not_count_and_one_car_has_no_interval():
    values = pd.DataFrame({"x": [1.0, np.nan, 3.0], "y": [np.nan] * 3})
    x, y = bootstrap_means(values, pd.Series(["a", "b", "c"]))
    assert 1.0 <= x[0] <= x[1] <= 3.0
    assert y == (None, None)
    assert bootstrap_means(values[["x"]], pd.Series(["a"] * 3)) == [(None, None)]


def test_scores_of_beliefs_by_hand():
    odds, truth = np.log(np.array([0.8, 0.6, 0.3, 0.1]) / np.array([0.2, 0.4, 0.7, 0.9])), np.array([1, 0, 1, 0], bool)
    found = scores(odds, truth)
    assert found["accuracy_pct"] == 50.0
    assert found["auc"] == 0.75  # three of the four pairs are in order
    assert found["brier"] == pytest.approx((0.2**2 + 0.6**2 + 0.7**2 + 0.1**2) / 4)
    assert found["log_loss"] == pytest.approx(-np.log([0.8, 0.4, 0.3, 0.9]).mean(), abs=1e-6)
    assert found["calibration_error"] == pytest.approx((0.2 + 0.6 + 0.7 + 0.1) / 4)


def test_a_rule_has_an_accuracy_alone():
    found = scores(np.array([np.inf, -np.inf, np.inf]), np.array([True, True, True]))
    assert found["accuracy_pct"] == pytest.approx(66.6667)
    assert [found[name] for name in ("auc", "brier", "log_loss", "calibration_error")] == [None] * 4


def test_some_certainty_leaves_an_order():
    found = scores(np.array([np.inf, 1.0, -np.inf, -2.0]), np.array([True, False, False, True]))
    assert found["auc"] == 0.75
    assert found["log_loss"] == pytest.approx(np.mean([0, np.log1p(np.e), 0, np.log1p(np.e**2)]), abs=1e-6)
    assert scores(np.array([np.inf, 1.0]), np.array([False, True]))["log_loss"] is None  # certain, and wrong


def labelled(n=200, seed=0):
    rng = np.random.default_rng(seed)
    odds = rng.normal(0, 2, n)
    truth = rng.random(n) < expit(odds)  # beliefs that are exactly right
    return [
        {
            "case": str(i),
            "car": str(i),
            "method": "m",
            "label": "NOT_YIELD" if truth[i] else "YIELD",
            "log_odds_40": odds[i],
            "arrival_lead_40": odds[i] if i % 2 else -odds[i],
            "ambiguity_s": i % 4,
            "correct_at_merge": bool(truth[i] == (odds[i] >= 0)),
            "first_stable_s": 1.0 if truth[i] == (odds[i] >= 0) else None,
        }
        for i in range(n)
    ]


def test_belief_rows_by_gate_and_start():
    rows = frame(*labelled(), {"case": "unlabelled", "method": "m", "log_odds_40": 1.0})
    found = belief(rows)
    assert set(found["gate_m"]) == {40}
    assert found.set_index("start")["n"].to_dict() == {"all": 200, "[0, 1) s": 50, "[1, 3) s": 100, ">= 3 s": 50}
    whole = found.iloc[0]
    assert whole["auc"] > 0.8
    assert 0.35 < whole["auc_arrival"] < 0.65
    bins = calibration(rows)
    assert bins["n"].sum() == 200
    assert whole["calibration_error"] == pytest.approx(
        (bins["n"] * (bins["mean_belief"] - bins["not_yield_share"]).abs()).sum() / 200, abs=1e-5
    )
    assert not len(belief(frame({"case": "x", "method": "m"})))


def test_stable_decisions_are_counted_among_labelled_cases():
    rows = labelled()
    row = summarise(frame(*rows), {}).iloc[0]
    stable = sum(one["first_stable_s"] is not None for one in rows)
    assert (row["labelled"], row["first_stable_pct"], row["first_stable_s"]) == (200, stable / 2, 1.0)


def test_strata_are_summaries_of_their_cases():
    parts = strata(frame(*labelled())).set_index("start")
    assert parts["n"].to_dict() == {"[0, 1) s": 50, "[1, 3) s": 100, ">= 3 s": 50}


def test_cars_with_several_cases_get_a_clustered_interval():
    rows = [{"case": str(i), "car": str(i // 2), "method": "m", "failed": i < 6} for i in range(40)]
    row = summarise(frame(*rows), {}).iloc[0]
    assert row["cars"] == 20
    assert row["cluster_low_pct"] <= row["failure_pct"] <= row["cluster_high_pct"]
    assert row["cluster_high_pct"] - row["cluster_low_pct"] > row["ci_high_pct"] - row["ci_low_pct"] - 5
    single = summarise(frame(*(one | {"car": one["case"]} for one in rows)), {}).iloc[0]
    assert pd.isna(single["cluster_low_pct"])
    half = [one | {"failed": i % 4 == 0, "censored": i % 2 == 1} for i, one in enumerate(rows)]
    assert summarise(frame(*half), {}).iloc[0]["cluster_high_pct"] > 60.0  # of 50 %: what is censored does not count
    none = summarise(frame(*(one | {"failed": False} for one in rows)), {}).iloc[0]
    assert pd.isna(none["cluster_high_pct"])  # not 0 to 0
    assert none["ci_high_pct"] > 8.0
    assert single["distance_low_m"] == single["distance_high_m"] == 10.0


def test_a_share_in_percent_has_four_decimals():
    assert (percent(1, 3), percent(2, 3), percent(1, 0)) == (33.3333, 66.6667, None)

"""Summary rows against counts by hand."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from merge_cosim.results.schema import SCHEMA
from merge_cosim.results.statistics import Summary, oracle_best, rates, totals
from merge_cosim.results.statistics.summary import COLUMNS

BASE = dict.fromkeys(SCHEMA.names) | {
    "scenario": "s",
    "variation": "",
    "site": "us101",
    "source": "ngsim",
    "car": "us101/a/1/1",
    "model": "",
    "failed": False,
    "failure_kind": "",
    "stuck": False,
    "censored": False,
    "extended": False,
    "smoothed_source": False,
    "host_reached": True,
    "host_first": True,
    "order_swapped": None,
    "label": "",
    "correct_at_merge": None,
    "decision_flips": 0,
    "distance_m": 10.0,
    "gap_m": 5.0,
    "min_gap_m": 5.0,
    "min_ttc_s": None,
    "delay_s": 1.0,
    "hardest_braking": 2.0,
    "host_reached_s": 3.0,
    "merging_reached_s": 4.0,
    "end_s": 6.0,
    "ambiguity_s": 0.5,
    "sumo_collision": False,
}


def frame(*rows):
    """Result rows as pandas reads them from a sweep's file."""
    table = pa.Table.from_pandas(pd.DataFrame([BASE | row for row in rows]), schema=SCHEMA, preserve_index=False)
    return table.to_pandas()


def summarise(rows, cycle_us, against=None):
    return Summary(len(rows), against).add(rows).table(cycle_us)


def strata(rows):
    return Summary(len(rows), None).add(rows).strata()


def test_rates_and_bounds():
    rows = [{"case": str(i), "method": "m"} for i in range(10)]
    rows[0] |= {"failed": True, "failure_kind": "side"}
    rows[1] |= {"failed": True, "failure_kind": "merging_into_host"}
    rows[2] |= {"censored": True}
    rows[3] |= {"censored": True}
    rows[4] |= {"stuck": True, "host_reached": False}
    row = summarise(frame(*rows), {"m": (1.0, 20.0)}).iloc[0]
    assert (row["n"], row["failures"], row["censored"]) == (8, 2, 2)
    assert row["failure_pct"] == 25.0
    assert row["failure_pct_best"] == 20.0
    assert row["failure_pct_worst"] == 40.0
    assert row["failure_pct_own"] == pytest.approx(100 / 7, abs=1e-3)
    assert (row["stuck"], row["failed_or_stuck_pct"], row["failed_or_stuck_pct_worst"]) == (1, 37.5, 50.0)
    for name, failures in (("ci", 2), ("failed_or_stuck", 3)):  # of 8, Wilson's 95 % by the formula
        z, p, n = 1.959964, failures / 8, 8
        middle, half = p + z * z / (2 * n), z * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5
        assert row[f"{name}_low_pct"] == pytest.approx(100 * (middle - half) / (1 + z * z / n), abs=1e-3)
        assert row[f"{name}_high_pct"] == pytest.approx(100 * (middle + half) / (1 + z * z / n), abs=1e-3)
    assert (row["cycle_us"], row["cycle_us_single"]) == (1.0, 20.0)


def test_only_rows_run_in_sumo_can_disagree_with_it():
    rows = [
        {"case": str(i), "method": world, "world": world, "failed": i < 3, "sumo_collision": i == 2}
        for world in ("sumo", "closed-form")
        for i in range(5)
    ]
    summary = summarise(frame(*rows), {}).set_index("method")
    assert summary.loc["sumo", "sumo_disagrees"] == 2
    assert pd.isna(summary.loc["closed-form", "sumo_disagrees"])


def test_oracle_best_takes_the_safe_one_then_the_quick_one():
    rows = frame(
        {"case": "a", "method": "always-go", "failed": True, "delay_s": 0.0},
        {"case": "a", "method": "always-yield", "delay_s": 9.0},
        {"case": "b", "method": "always-go", "delay_s": 0.5},
        {"case": "b", "method": "always-yield", "delay_s": 9.0},
        {"case": "c", "method": "always-go"},  # its rival was not run
        {"case": "a", "method": "acc"},
    )
    best = oracle_best(pa.Table.from_pandas(rows, schema=SCHEMA, preserve_index=False)).to_pandas().set_index("case")
    assert best["delay_s"].to_dict() == {"a": 9.0, "b": 0.5}
    assert set(best["method"]) == {"oracle-best"}


def test_unnecessary_yields_need_a_safe_first_passage_of_always_go():
    go = {"method": "always-go", "gap_m": 2.0}
    rows = frame(
        {"case": "possible", **go},
        {"case": "close", **go, "gap_m": 1.9},
        {"case": "failing", **go, "failed": True},
        {"case": "second", **go, "host_first": False},
        *({"case": case, "method": "m", "host_first": False} for case in ("possible", "close", "failing", "second")),
    )
    summary = summarise(rows, {}).set_index("method")
    assert summary.loc["m", "unnecessary_yields"] == 1
    assert summary.loc["always-go", "unnecessary_yields"] == 0
    alone = summarise(frame({"case": "x", "method": "m"}, {"case": "y", "method": "m", "host_first": False}), {}).iloc[
        0
    ]
    assert pd.isna(alone["unnecessary_yields"])


def test_living_traffic_has_no_case_in_common():
    methods = ("always-go", "always-yield", "m")
    rows = frame(
        *(
            {"case": "000/h.0/m.0", "method": name, "source": "traffic", "host_first": name == "always-go"}
            for name in methods
        )
    )
    assert not len(oracle_best(pa.Table.from_pandas(rows, schema=SCHEMA, preserve_index=False)))
    summary = summarise(rows, {}, against="always-go").set_index("method")
    assert summary[["unnecessary_yields", "only_this_fails", "mcnemar_p"]].isna().all().all()
    logged = summarise(rows.assign(source="ngsim"), {}, against="always-go").set_index("method")
    assert (logged.loc["m", "unnecessary_yields"], logged.loc["m", "only_this_fails"]) == (1, 0)


def test_sites_are_pooled_only_within_one_source():
    one = frame({"case": "a", "method": "m"}, {"case": "b", "method": "m", "site": "i80"})
    assert summarise(one, {})["site"].tolist() == ["all", "i80", "us101"]
    two = frame({"case": "a", "method": "m"}, {"case": "b", "method": "m", "site": "i80", "source": "surrogate"})
    assert summarise(two, {})["site"].tolist() == ["i80", "us101"]


def test_a_summary_needs_its_own_columns_alone_and_compares_within_a_test():
    def rows(scenario, **failing):
        same = {"scenario": scenario, "source": "random", "car": ""}
        return [
            same | {"case": f"{case}", "method": method, "failed": case in cases}
            for method, cases in failing.items()
            for case in range(6)
        ]

    first, second = rows("a", pgm=[0], acc=[0]), rows("b", pgm=[], acc=[1, 2, 3])
    whole = summarise(frame(*first, *second), {}, "pgm")
    pd.testing.assert_frame_equal(summarise(frame(*first, *second)[list(COLUMNS)], {}, "pgm"), whole)
    for scenario, part in (("a", first), ("b", second)):
        alone = summarise(frame(*part), {}, "pgm").reset_index(drop=True)
        pd.testing.assert_frame_equal(whole[whole["scenario"] == scenario].reset_index(drop=True), alone)


def test_a_fixed_grid_has_no_interval():
    row = summarise(frame({"case": "a", "method": "m", "source": "designed"}), {}).iloc[0]
    assert pd.isna(row["ci_low_pct"])


def test_every_column_is_defined_on_the_page_of_measures():
    page = (Path(__file__).parents[2] / "docs" / "measures.md").read_text(encoding="utf-8")
    summary = summarise(frame({"case": "a", "method": "m"}), {})
    columns = {re.sub(r"^(log_odds|arrival_lead)_\d+$", r"\1_G", name) for name in (*SCHEMA.names, *summary)}
    assert columns - set(re.findall(r"`(\w+)`", page)) == set()


@pytest.mark.parametrize("most_clusters", [10_000, 100])
def test_a_summary_of_batches_is_that_of_the_whole(monkeypatch, most_clusters):
    monkeypatch.setattr(rates, "MOST_CLUSTERS", most_clusters)
    monkeypatch.setattr(totals, "MOST_CLUSTERS", most_clusters)
    rng = np.random.default_rng(3)
    cases = [
        {"case": f"c{i:04d}", "car": "", "source": "random", "ambiguity_s": rng.uniform(0, 5), "site": "designed"}
        for i in range(400)
    ]
    rows = frame(
        *(
            case
            | {"method": method, "failed": rng.random() < 0.3, "censored": rng.random() < 0.1}
            | {"distance_m": rng.exponential(), "hardest_braking": rng.normal(), "host_first": bool(rng.random() < 0.5)}
            | {"min_ttc_s": rng.exponential() if rng.random() < 0.8 else None}
            for case in cases
            for method in ("acc", "always-go", "pgm")
        )
    )
    whole = Summary(len(rows), "pgm").add(rows)
    batches = Summary(len(rows), "pgm")
    for first in range(0, len(rows), 150):
        batches.add(rows.iloc[first : first + 150])
    times = {"acc": (1.0, 2.0)}
    pd.testing.assert_frame_equal(batches.table(times), whole.table(times), atol=1e-6)
    pd.testing.assert_frame_equal(batches.strata(), whole.strata(), atol=1e-6)
    acc = rows[rows["method"] == "acc"]
    row = batches.table(times).set_index("method").loc["acc"]
    assert row["min_ttc_s_p05"] == pytest.approx(acc["min_ttc_s"].quantile(0.05), abs=1e-6)
    assert row["hardest_braking_p95"] == pytest.approx(acc["hardest_braking"].quantile(0.95), abs=1e-6)
    assert row["distance_m"] == pytest.approx(acc["distance_m"].mean(), abs=1e-6)


def test_cars_of_two_batches_stay_apart(monkeypatch):
    monkeypatch.setattr(totals, "MOST_CLUSTERS", 2)
    clusters = totals.Clusters()
    for first in (0, 3):  # a car may also have rows in another batch, so none of these is whole
        cars = pd.Series([f"car {first + i}" for i in range(3)])
        clusters.add(pd.DataFrame({"value": [1.0, 2.0, 3.0]}), cars, whole=False)
    assert clusters.number == 6

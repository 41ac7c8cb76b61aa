"""Several models of one method: their spread, and how often one method beats another."""

import pandas as pd
import pytest

from merge_cosim.results.statistics.ensemble import ensemble, rivals

SECTION = {"scenario": "s", "variation": "", "site": "us101", "source": "ngsim"}


def row(method, model, failures, delay, n=10):
    rate = 100.0 * failures / n
    measures = {"failure_pct": rate, "failed_or_stuck_pct": rate, "delay_s": delay, "distance_m": 20.0}
    return SECTION | {"method": method, "model": model, "n": n, "failures": failures} | measures


SUMMARY = pd.DataFrame(
    [
        row("acc", "", 2, 0.5),
        *(row("pgm", f"m{k}", failures, delay) for k, (failures, delay) in enumerate(((1, 1.0), (4, 3.0), (2, 1.5)))),
        *(row("fg", f"m{k}", failures, 2.0) for k, failures in enumerate((0, 4, 3))),
    ]
)


def test_median_and_range_over_models():
    found = ensemble(SUMMARY).set_index("method")
    assert list(found.index) == ["fg", "pgm"]  # acc has no model
    pgm = found.loc["pgm"]
    assert (pgm["models"], pgm["n"], pgm["failures"]) == (3, 30, 7)
    assert pgm["failure_pct"] == pytest.approx(100 * 7 / 30, abs=1e-3)
    assert (pgm["failure_pct_median"], pgm["failure_pct_min"], pgm["failure_pct_max"]) == (20.0, 10.0, 40.0)
    assert (pgm["delay_s_median"], pgm["delay_s_min"], pgm["delay_s_max"]) == (1.5, 1.0, 3.0)


def test_how_often_one_beats_another():
    found = rivals(SUMMARY).set_index(["first", "second"])
    counts = ["models", "first_better", "equal", "second_better"]
    assert found.loc[("acc", "pgm"), counts].tolist() == [3, 1, 1, 1]
    assert found.loc[("acc", "fg"), counts].tolist() == [3, 2, 0, 1]
    assert found.loc[("fg", "pgm"), counts].tolist() == [3, 1, 1, 1]


def test_one_model_makes_no_ensemble():
    single = SUMMARY[SUMMARY["model"].isin(["", "m0"])]
    assert ensemble(single).empty
    assert rivals(single).empty

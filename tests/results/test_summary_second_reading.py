"""Every column of the summary again, by plain loops over random rows; and the small rules that it rests on."""

import math
import random
import statistics

import numpy as np
import pandas as pd
import pytest
from scipy.stats import fisher_exact
from test_summaries import strata, summarise

from merge_cosim.results.schema import SCHEMA
from merge_cosim.results.statistics.rates import percent, wilson
from merge_cosim.results.statistics.summary import MEANS, QUANTILES, is_sample, is_sample_source, with_all_sites
from merge_cosim.results.statistics.verdict import verdict, verdicts

NUMBERS = ("distance_m", "gap_m", "delay_s", "hardest_braking", "mean_jerk", "human_station_rms_m", "human_speed_rms")
NUMBERS += ("min_ttc_s", "max_drac", "pet_s", "min_leader_gap_m", "min_leader_ttc_s", "min_follower_gap_m")
FLAGS = ("failed", "censored", "stuck", "deadlock", "extended", "host_reached", "sumo_collision", "smoothed_source")
MAYBE = ("in_support", "correct_at_merge", "order_swapped", "host_first", "merging_stopped")
METHODS = ("acc", "always-go", "pgm")


def made(seed: int, source: str = "ngsim") -> list[dict]:
    """Rows of 60 cases of two sites under three methods, with gaps in what may be missing."""
    rng = random.Random(seed)
    rows = []
    for case in range(60):
        site, start = ("us101", "i80")[case % 3 == 0], rng.choice([0.0, 0.5, 1.0, 2.0, 3.0, 7.0])
        for method in METHODS:
            row = dict.fromkeys(SCHEMA.names) | {"scenario": "s", "variation": "", "site": site, "source": source}
            row |= {"case": f"c{case}", "car": f"car{case}", "method": method, "model": "", "ambiguity_s": start}
            row |= {name: rng.choice([None, rng.uniform(-5.0, 9.0)]) for name in NUMBERS}
            row |= {name: rng.random() < 0.3 for name in FLAGS}
            row |= {name: rng.choice([None, True, False]) for name in MAYBE}
            row |= {"decision_flips": rng.randrange(4), "first_stable_s": rng.choice([None, rng.random()])}
            row |= {"label": "", "world": rng.choice(["sumo", "closed-form"])}
            kinds = ("side", "merging_into_host", "host_into_merging")
            row["stuck"] &= not row["failed"]
            row["failure_kind"] = rng.choice(kinds) if row["failed"] else ""
            rows.append(row)
    return rows


def table(rows: list[dict]) -> pd.DataFrame:
    import pyarrow as pa

    return pa.Table.from_pandas(pd.DataFrame(rows), schema=SCHEMA, preserve_index=False).to_pandas()


def mean(values: list, factor: float = 1.0) -> float | None:
    known = [float(value) for value in values if value is not None]
    return factor * statistics.fmean(known) if known else None


def quantile(values: list, q: float) -> float | None:
    known = sorted(value for value in values if value is not None)
    return float(np.quantile(known, q)) if known else None


def plain(rows: list[dict], go: dict[str, dict]) -> dict:
    """What the summary says of one method, by counting."""
    scored = [row for row in rows if not row["censored"]]
    failed = [row for row in scored if row["failed"]]
    own = [row for row in scored if row["failure_kind"] != "merging_into_host"]
    stuck = [row for row in scored if row["stuck"]]
    supported = [row for row in rows if row["in_support"] is not None]
    labelled = [row for row in rows if row["correct_at_merge"] is not None]
    in_sumo = [row for row in rows if row["world"] == "sumo"]
    censored = len(rows) - len(scored)
    stable = [row["first_stable_s"] for row in labelled]

    def needless(row: dict) -> bool:
        other = go[row["case"]]
        wide = other["gap_m"] is None or other["gap_m"] >= 2.0
        return row["host_first"] is False and other["host_first"] is True and not other["failed"] and wide

    def true(name: str) -> int | None:
        known = [row[name] for row in rows if row[name] is not None]
        return sum(known) if known else None

    columns = {name: [row[name] for row in rows] for name in SCHEMA.names}
    low, high = wilson(len(failed), len(scored))
    stuck_low, stuck_high = wilson(len(failed) + len(stuck), len(scored))
    return {
        "n": len(scored),
        "failures": len(failed),
        "failure_pct": percent(len(failed), len(scored)),
        "ci_low_pct": low,
        "ci_high_pct": high,
        "failure_pct_own": percent(sum(row["failed"] for row in own), len(own)),
        "censored": censored,
        "failure_pct_best": percent(len(failed), len(rows)),
        "failure_pct_worst": percent(len(failed) + censored, len(rows)),
        "stuck": len(stuck),
        "deadlocks": sum(row["deadlock"] for row in scored),
        "outside_support": sum(not row["in_support"] for row in supported),
        "failed_or_stuck_pct": percent(len(failed) + len(stuck), len(scored)),
        "failed_or_stuck_low_pct": stuck_low,
        "failed_or_stuck_high_pct": stuck_high,
        "failed_or_stuck_pct_worst": percent(len(failed) + len(stuck) + censored, len(rows)),
        "extended": sum(columns["extended"]),
        "host_not_reached": sum(not reached for reached in columns["host_reached"]),
        "host_first_pct": mean(columns["host_first"], 100.0),
        **{name: mean(columns[name]) for name in MEANS if name not in ("distance_m_safe", "first_stable_s")},
        "distance_m_safe": mean([row["distance_m"] for row in rows if not row["failed"]]),
        "first_stable_s": mean(stable),
        "first_stable_pct": percent(sum(value is not None for value in stable), len(labelled)),
        **{name: quantile(columns[column], q) for name, (column, q) in QUANTILES.items()},
        "merging_stopped": true("merging_stopped"),
        "order_swapped": true("order_swapped"),
        "unnecessary_yields": sum(map(needless, rows)),
        "labelled": len(labelled),
        "correct_at_merge_pct": mean(columns["correct_at_merge"], 100.0),
        "sumo_disagrees": sum(row["sumo_collision"] != row["failed"] for row in in_sumo),
        "cars": len(rows),
    }


def compared(found: pd.Series, rows: list[dict], every: list[dict]) -> None:
    go = {row["case"]: row for row in every if row["method"] == "always-go"}
    expected = plain(rows, go)
    for name, value in expected.items():
        assert float(found[name]) == pytest.approx(math.nan if value is None else value, abs=2e-6, nan_ok=True), name


@pytest.mark.parametrize("seed", [1, 2])
def test_every_column_is_that_of_plain_loops(seed):
    rows = made(seed)
    found = summarise(table(rows), {"acc": (1.23456, 2.34567), "pgm": (3.0, None)}, "pgm")
    assert found[["site", "method"]].values.tolist() == [[site, m] for site in ("all", "i80", "us101") for m in METHODS]
    for _, one in found.iterrows():
        here = [row for row in rows if one["site"] in (row["site"], "all")]
        own = [row for row in here if row["method"] == one["method"]]
        compared(one, own, rows)
        other = {row["case"]: row for row in here if row["method"] == "pgm"}
        both = [(row, other[row["case"]]) for row in own if not row["censored"] and not other[row["case"]]["censored"]]
        if one["method"] == "pgm":
            assert pd.isna(one["only_this_fails"])
        else:
            assert one["only_this_fails"] == sum(row["failed"] and not of["failed"] for row, of in both)
            assert one["only_other_fails"] == sum(of["failed"] and not row["failed"] for row, of in both)
    times = found.set_index("method").loc[:, ["cycle_us", "cycle_us_single"]]
    assert times.loc["acc"].drop_duplicates().values.tolist() == [[1.235, 2.346]]
    assert times.loc["pgm"].isna().any(axis=0).tolist() == [False, True]
    assert times.loc["always-go"].isna().all(axis=None)


def test_the_strata_are_those_of_plain_loops():
    rows = made(3)
    rows += [row | {"variation": "v", "case": f"v{row['case']}"} for row in rows]
    found = strata(table(rows))
    assert (found["variation"] == "").all()
    edges = {"[0, 1) s": (0, 1), "[1, 3) s": (1, 3), ">= 3 s": (3, math.inf)}
    assert list(dict.fromkeys(found["start"])) == list(edges)
    for _, one in found.iterrows():
        low, high = edges[one["start"]]
        own = [
            row
            for row in rows
            if row["method"] == one["method"]
            and row["variation"] == ""
            and one["site"] in (row["site"], "all")
            and low <= row["ambiguity_s"] < high
        ]
        compared(one, own, [row for row in rows if row["variation"] == ""])


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_missing_everywhere_is_missing(seed):
    rows = [row | dict.fromkeys((*NUMBERS, *MAYBE, "first_stable_s")) | {"world": "closed-form"} for row in made(seed)]
    found = summarise(table([row for row in rows if row["method"] == "acc"]), {}).iloc[0]
    gone = (*QUANTILES, "outside_support", "merging_stopped", "order_swapped", "correct_at_merge_pct", "sumo_disagrees")
    for name in (
        *gone,
        "first_stable_pct",
        "first_stable_s",
        "host_first_pct",
        "unnecessary_yields",
        "delay_s",
        "gap_m",
    ):
        assert pd.isna(found[name]), name
    assert found["labelled"] == 0


@pytest.mark.parametrize("source", ["a", "ngsim", "designed", "traffic"])
def test_only_the_designed_grid_is_no_sample(source):
    sample = source != "designed"
    assert (is_sample_source(source), is_sample(pd.DataFrame({"source": [source] * 2}))) == (sample, sample)
    assert not is_sample(pd.DataFrame({"source": ["designed", source]}))
    found = summarise(table(made(4, source)), {}, "pgm")
    assert found["ci_low_pct"].notna().all() == sample
    assert found["distance_low_m"].notna().all() == sample
    assert found["mcnemar_p"].notna().any() == (sample and source != "traffic")


def rows_of(source: str, /, **methods: list[tuple]) -> pd.DataFrame:
    """Summary rows from (n, failures, delay, model) by method."""
    same = {"scenario": "s", "variation": "", "site": "x", "source": source, "stuck": 0}
    return pd.DataFrame(
        [
            same | {"method": name, "n": n, "failures": failures, "delay_s": delay, "model": model}
            for name, found in methods.items()
            for n, failures, delay, model in found
        ]
    )


def test_only_results_of_common_models_are_compared():
    """Of `a` and `b` the models m and k are common: a is better with both, though not with the other's."""
    one = rows_of("designed", a=[(40, 1, 1.0, "k"), (40, 11, 1.0, "m")], b=[(40, 5, 1.0, "k"), (40, 15, 1.0, "m")])
    assert verdict(one).undecided == ()
    assert verdict(one).sentence.endswith("Every trained model agrees that a is best.")
    # a method without a model is compared with every model
    none = rows_of("designed", a=[(40, 8, 1.0, "")], b=[(40, 5, 1.0, "k"), (40, 15, 1.0, "m")])
    assert verdict(none).undecided == ("b",)
    assert verdict(none).sentence.endswith("Which of a and b is better depends on the trained model.")


@pytest.mark.parametrize("failures", [1, 5, 6, 9, 10])
def test_scenes_are_compared_by_fishers_test(failures):
    p = fisher_exact([[1, 29], [failures, 30 - failures]]).pvalue
    found = verdict(rows_of("traffic", a=[(30, 1, 1.0, "")], b=[(30, failures, 2.0, "")]))
    assert (found.undecided == ("b",)) == (p >= 0.05)


def test_who_is_beyond_chance_and_who_is_not():
    tied = {"a": [(60, 0, 1.0, "")], "b": [(60, 0, 2.0, "")], "c": [(60, 30, 1.0, "")]}
    assert verdict(rows_of("traffic", **tied)).sentence.endswith(
        "Every difference of a and b from the others is beyond chance (p < 0.05, Holm)."
    )
    open_ = tied | {"d": [(60, 1, 1.0, "")]}
    assert verdict(rows_of("traffic", **open_)).sentence.endswith(
        "Differences between a and d are undecided (p ≥ 0.05, Holm)."
    )
    alone = {"a": [(60, 0, 1.0, "")], "c": [(60, 30, 1.0, "")]}
    assert verdict(rows_of("traffic", **alone)).sentence.endswith(
        "Every difference of a from the others is beyond chance (p < 0.05, Holm)."
    )
    all_open = {"a": [(60, 0, 1.0, "")], "b": [(60, 1, 1.0, "")], "c": [(60, 2, 1.0, "")]}
    assert verdict(rows_of("traffic", **all_open)).sentence.endswith(
        "All differences from a are undecided (p ≥ 0.05, Holm)."
    )


def test_methods_that_tie_under_every_model_are_undecided_and_so_are_those_without_a_common_model():
    same = [(40, 1, 1.0, "k"), (40, 3, 1.0, "m")]
    assert verdict(rows_of("designed", a=same, b=same)).undecided == ("b",)
    apart = rows_of("designed", a=[(40, 1, 1.0, "k")] * 2, b=[(40, 9, 1.0, "m")] * 2)
    assert verdict(apart).undecided == ("b",)


def test_a_verdict_is_on_the_rows_of_its_own_scenario():
    def rows(scenario, bad):
        same = {"scenario": scenario, "variation": "", "site": "x", "source": "random", "model": "", "car": ""}
        same |= {"censored": False, "stuck": False}
        return [
            same | {"method": method, "case": f"{case}", "failed": case < failures}
            for method, failures in (("a", 0), ("b", bad))
            for case in range(40)
        ]

    summary = rows_of("random", a=[(40, 0, 1.0, "")], b=[(40, 9, 1.0, "")]).assign(variation="")
    both = pd.concat([summary, summary.assign(scenario="t")])
    found = verdicts(both, pd.DataFrame(rows("s", 9) + rows("t", 2)))
    assert [one.undecided for one in found.values()] == [(), ("b",)]


def test_all_sites_are_added_where_a_scenario_has_several_of_one_source():
    def frame(*sites_and_sources):
        return pd.DataFrame([{"scenario": "s", "site": site, "source": source} for site, source in sites_and_sources])

    several = frame(("x", "ngsim"), ("y", "ngsim"))
    assert with_all_sites(several)["site"].tolist() == ["x", "y", "all", "all"]
    for one in (frame(("x", "ngsim"), ("x", "ngsim")), frame(("x", "ngsim"), ("y", "surrogate"))):
        assert with_all_sites(one).equals(one)

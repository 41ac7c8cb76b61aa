"""The verdict's sentence on small tables whose counts are known."""

import pandas as pd
import pytest
from scipy.stats import fisher_exact

from merge_cosim.results.statistics.paired import holm
from merge_cosim.results.statistics.verdict import percent, verdict, verdicts


def _summary(source="designed", /, **methods):
    """Summary rows from (n, failures, stuck, delay) by method."""
    keys = ("n", "failures", "stuck", "delay_s")
    same = {"scenario": "s", "variation": "", "site": "x", "source": source}
    return pd.DataFrame(
        [same | {"method": name.replace("_", "-")} | dict(zip(keys, row, strict=True)) for name, row in methods.items()]
    )


def _rows(source, /, **failing):
    """Result rows of 40 cases; by method the numbers of the cases that failed."""
    same = {"scenario": "s", "variation": "", "site": "x", "source": source, "model": ""}
    same |= {"car": "", "censored": False, "stuck": False}
    return pd.DataFrame(
        [same | {"method": m, "case": f"{i}", "failed": i in bad} for m, bad in failing.items() for i in range(40)]
    )


def test_a_grid_has_counts_without_a_test_and_references_do_not_compete():
    found = verdict(
        _summary(
            pgm=(6875, 186, 175, 2.0), ipcb=(6875, 0, 0, 0.9), acc=(6875, 196, 0, 0.6), oracle_best=(6875, 0, 0, 0.0)
        )
    )
    assert found.sentence == (
        "ipcb fails or gets stuck least: 0 of 6,875 cases; acc 196 (2.9 %); pgm 361 (5.3 %). "
        "The cases are a fixed grid: the counts are exact for it, not a sample."
    )
    assert (found.order, found.best, found.undecided) == (("ipcb", "acc", "pgm"), ("ipcb",), ())


def test_ties_are_named_together_the_faster_first():
    found = verdict(_summary(slow=(27, 1, 0, 2.0), fast=(27, 1, 0, 1.0), bad=(27, 27, 0, 0.0)))
    assert found.sentence.startswith(
        "fast and slow fail least: 1 of 27 cases each (3.7 %), fast with the least mean delay of these "
        "(1.00 s, then slow 2.00 s); "
        "bad 27 (100.0 %)."
    )
    assert found.best == ("fast", "slow")
    assert found.headline == found.sentence.partition(";")[0]


def test_many_methods_are_counted_after_the_first():
    methods = {f"m{i}": (100, i, 0, 1.0) for i in range(9)}
    assert verdict(_summary(**methods)).sentence.startswith(
        "m0 fails least: 0 of 100 cases; m1 1 (1.0 %); m2 2 (2.0 %); m3 3 (3.0 %); m4 4 (4.0 %); "
        "4 more up to 8 (8.0 %) (m8)."
    )


def test_a_single_one_is_not_counted_but_named():
    methods = {f"m{i}": (100, i, 0, 1.0) for i in range(6)}
    assert "; m3 3 (3.0 %); m4 4 (4.0 %); m5 5 (5.0 %). The" in verdict(_summary(**methods)).sentence
    tied = {f"m{i}": (100, 1, 0, float(i)) for i in range(6)} | {"bad": (100, 9, 0, 1.0)}
    assert verdict(_summary(**tied)).sentence.startswith("m0, m1, m2, m3 and 2 more fail least")
    del tied["m5"]
    assert verdict(_summary(**tied)).sentence.startswith("m0, m1, m2, m3 and m4 fail least")


@pytest.mark.parametrize(
    ("methods", "sentence"),
    [
        ({}, "Only references were run: there is no method to judge."),
        ({"always_go": (9, 1, 0, 0.0)}, "Only references were run: there is no method to judge."),
        ({"acc": (0, 0, 0, None)}, "No case could be scored to the end: there is nothing to judge."),
        (
            {"pgm": (100, 2, 1, 1.0)},
            "pgm: 3 of 100 cases failed or stuck (3.0 %); 2 failed, 1 stuck. No other method to compare with.",
        ),
        ({"acc": (9, 0, 0, 1.0)}, "acc: 0 of 9 cases failed (0.0 %). No other method to compare with."),
        (
            {"acc": (9, 0, 0, 1.0), "pgm": (9, 0, 0, 0.5)},
            "No difference between pgm and acc: each 0 of 9 cases failed, "
            "pgm with the least mean delay of these (0.50 s, then acc 1.00 s).",
        ),
        (
            {"acc": (9, 9, 0, 1.0), "pgm": (8, 8, 0, 0.5)},
            "No difference between pgm and acc: 100.0 % failed.",
        ),
    ],
)
def test_borderline_tables(methods, sentence):
    assert verdict(_summary(**methods)).sentence == sentence


def test_a_sample_is_judged_on_the_same_cases():
    rows = _rows("random", a=[0], b=range(9), c=[1, 2])
    found = verdict(_summary("random", a=(40, 1, 0, 1.0), b=(40, 9, 0, 1.0), c=(40, 2, 0, 1.0)), rows)
    # a against b: case 0 fails under both, 8 under b alone: p = 2 / 2^8, times 2; against c: 1 and 2, p = 1
    assert found.undecided == ("c",)
    assert found.sentence == (
        "a fails least: 1 of 40 cases (2.5 %); c 2 (5.0 %); b 9 (22.5 %). "
        "Differences between a and c are undecided (p ≥ 0.05, Holm)."
    )


@pytest.mark.parametrize("bad", ["failed", "stuck"])
def test_on_common_cases_to_be_stuck_is_as_bad_as_to_fail(bad):
    rows = _rows("random", a=range(40), b=range(9)).assign(failed=False)
    rows[bad] = rows["case"].astype(int).between(31, 39) & (rows["method"] == "b")
    summary = _summary("random", a=(40, 0, 0, 1.0), b=(40, 9, 0, 1.0))
    assert verdict(summary, rows).undecided == ()  # 9 of 9: p = 2 / 2^9
    rows["censored"] = rows["case"].astype(int) > 35  # 5 of 5 are left: p = 0.06
    assert verdict(summary, rows).undecided == ("b",)


def test_common_cases_decide_what_the_counts_alone_do_not():
    summary = _summary("random", a=(40, 1, 0, 1.0), b=(40, 7, 0, 1.0))
    assert fisher_exact([[1, 39], [7, 33]]).pvalue > 0.05 > 2 / 2**6  # McNemar's, of the six that fail under b alone
    assert verdict(summary).undecided == ("b",)
    assert verdict(summary, _rows("random", a=[0], b=range(7))).undecided == ()


def test_without_common_cases_by_fishers_test():
    summary = _summary("traffic", a=(30, 0, 0, 1.0), b=(30, 6, 0, 1.0), c=(31, 20, 1, 1.0))
    assert fisher_exact([[0, 30], [6, 24]]).pvalue == pytest.approx(0.0237, abs=1e-4)
    found = verdict(summary, _rows("traffic", a=[], b=[], c=[]))
    assert found.undecided == ()
    assert found.sentence.endswith(
        "b 6 of 30 (20.0 %); c 21 of 31 (67.7 %). "
        "Every difference of a from the others is beyond chance (p < 0.05, Holm)."
    )
    assert verdict(summary.assign(failures=[0, 5, 6])).undecided == ("b",)


def test_holm_against_its_textbook_steps():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([]) == []


def test_small_shares_show_two_decimals():
    assert [percent(value) for value in (0.0, 0.04, 0.1, 12.34)] == ["0.0 %", "0.04 %", "0.1 %", "12.3 %"]


def test_one_verdict_for_each_site_and_the_rows_of_all_sites_together():
    def at(site):
        return _summary("random", a=(40, 0, 0, 1.0), b=(40, 8, 0, 1.0)).assign(site=site)

    rows = _rows("random", a=[], b=range(8))
    both = pd.concat([rows, rows.assign(site="y", case=rows["case"] + "y")])
    found = verdicts(pd.concat([at("x"), at("y"), at("all")]).assign(), both)
    assert list(found) == [("s", "x", "random"), ("s", "y", "random"), ("s", "all", "random")]
    assert all(one.undecided == () for one in found.values())


def test_a_site_is_judged_on_its_own_cases():
    summary = pd.concat([_summary("random", a=(40, 0, 0, 1.0), b=(40, 8, 0, 1.0)).assign(site=site) for site in "xy"])
    there = _rows("random", a=range(8), b=[]).assign(site="y", case=lambda rows: rows["case"] + "y")
    found = verdicts(summary, pd.concat([_rows("random", a=[], b=range(8)), there]))
    assert found["s", "x", "random"].undecided == ()


def _models(source, /, **shares):
    """Summary rows of methods with several models of 40 cases, from the failures under each; and their rows."""
    same = {"scenario": "s", "variation": "", "site": "x", "source": source, "n": 40, "stuck": 0, "delay_s": 1.0}
    key = {
        "scenario": "s",
        "variation": "",
        "site": "x",
        "source": source,
        "car": "",
        "censored": False,
        "stuck": False,
    }
    runs = [(method, f"m{i}", bad) for method, found in shares.items() for i, bad in enumerate(found)]
    rows = [key | {"method": m, "model": k, "case": f"{i}", "failed": i < bad} for m, k, bad in runs for i in range(40)]
    return pd.DataFrame([same | {"method": m, "model": k, "failures": bad} for m, k, bad in runs]), pd.DataFrame(rows)


def test_a_method_with_several_models_is_judged_by_its_median_model():
    found = verdict(*_models("designed", a=[0, 2, 1], b=[30, 20, 10], c=[3, 1, 4]))
    assert found.order == ("a", "c", "b")
    assert found.undecided == ("c",)  # better than a with the second model
    assert found.sentence == (
        "a fails least: median 2.5 %, 0.0–5.0 % over 3 models of 40 cases; c median 7.5 %, 2.5–10.0 % over 3 models; "
        "b median 50.0 %, 25.0–75.0 % over 3 models. Which of a and c is better depends on the trained model."
    )


def test_one_method_with_several_models_alone():
    sentence = "a: median 2.5 %, 0.0–5.0 % over 3 models of 40 cases failed. No other method to compare with."
    assert verdict(*_models("designed", a=[0, 2, 1])).sentence == sentence


def test_of_a_sample_every_model_must_be_beyond_chance():
    decided = verdict(*_models("random", a=[0, 0], b=[8, 9]))
    assert decided.undecided == ()
    assert verdict(*_models("random", a=[0, 0], b=[8, 4])).undecided == ("b",)  # 4 of 4: p = 0.125

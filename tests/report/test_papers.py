"""The reproduction of the papers on a small part of each test: real sweeps, one page, tables and verdicts."""

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import results_page

from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.model import MODELS
from merge_cosim.ngsim.sites import site
from merge_cosim.report.methods import looks
from merge_cosim.report.published import published
from merge_cosim.results.store import RESULTS
from merge_cosim.studies import reproduction
from merge_cosim.studies.papers import cases, claims, figures, tables
from merge_cosim.studies.papers.evidence import Evidence, gather
from merge_cosim.studies.papers.page import write_reproduction
from merge_cosim.studies.reproduction import DESIGNED, MODEL_SWEEP, NODE_SWEEP, PAIRS, Study, run, studies
from merge_cosim.studies.training import train
from merge_cosim.sweeps.sweep import SweepRequest

pytestmark = pytest.mark.slow
METHODS = ("acc", "slot", "ipcb", "pgm-g", "pgm", "fg", "fg-gmm", "always-go", "human")
COARSE = {f"encounters.{name}.step": 12 for name in ("host_speed", "merging_speed")} | {
    "encounters.host_offset.step": 5
}


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> list[Study]:
    """A grid of few speeds, and the surrogate's pairs that a model was not trained on."""
    several = tmp_path_factory.mktemp("models")
    shutil.copy(MODELS / "us101-ngsim.json", several)
    model = several / "us101-surrogate.json"
    train("us101", None, "surrogate", "car", 0, model)
    designed = SweepRequest(("designed-2",), METHODS, settings=COARSE, world="closed-form")
    pairs = SweepRequest(("us101-replay",), METHODS, str(model), source="surrogate")
    varied = [("pgm.nodes", (1, 52, 80))]
    nodes = replace(pairs, methods=("pgm",), variations=varied, world="closed-form")
    return [
        Study(DESIGNED, DESIGNED, designed),
        Study(PAIRS, "surrogate", pairs),
        Study(NODE_SWEEP, "surrogate", nodes),
        Study(MODEL_SWEEP, "surrogate", replace(designed, methods=("pgm", "pgm-g", "ipcb"), model=str(several))),
    ]


@pytest.fixture(scope="module")
def reproduced(small: list[Study], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("reproduction")
    run(small, out)
    write_reproduction(small, out, lambda done, total, what: None)
    return out


@pytest.fixture(scope="module")
def evidence(small: list[Study], reproduced: Path) -> Evidence:
    (found,) = gather(small, reproduced)
    return found


def test_the_page_shows_every_part_offline(reproduced):
    page = (reproduced / "report.html").read_text(encoding="utf-8")
    for title in (
        "Table I)",
        "Table II; FG-GMM",
        "Validity of FG",
        "speed nodes",
        "on camera",
        "particle filter",
        "Fig. 3",
    ):
        assert title in page
    assert "SYNTHETIC" in page
    assert not re.search(r'(src|href)="https?:', page)
    for link in re.findall(r'href="([^"#]+)"', page):
        assert (reproduced / link).is_file()
    names = {file.stem for file in (reproduced / "tables").glob("*.csv")}
    assert {
        f"surrogate-{name}"
        for name in ("claims", "data-sets", "failures", "bounds", "same-cases", "validity", "mixture", "nodes")
    } <= names
    assert names == {file.stem for file in (reproduced / "tables").glob("*.tex")}


def test_ours_stand_beside_theirs(evidence):
    table = tables.outcomes(evidence)["failures"].data.set_index("method")
    rows = evidence.cases("designed-2")
    for method in ("acc", "ipcb", "pgm"):
        ours = 100 * rows.loc[rows["method"] == method, "failed"].mean()
        assert table.loc[method, "designed-2_failure_pct"] == pytest.approx(ours, abs=1e-3)
        assert table.loc[method, "designed-2_published"] == published("designed-2", method).failure_pct


def test_learned_methods_have_a_range_over_models(evidence):
    table = tables.over_models(evidence).data.set_index("method")
    rates = evidence.by_model[evidence.by_model["method"] == "pgm"]["failure_pct"]
    assert table.loc["pgm", "models"] == 2
    assert table.loc["pgm", ["failure_pct_min", "failure_pct_max"]].tolist() == [rates.min(), rates.max()]


def test_pairs_carried_on_stand_apart(evidence):
    table = tables.extended(evidence).data.set_index("method")
    rows = evidence.cases("us101-replay")
    for method in ("acc", "fg"):
        scored = rows[(rows["method"] == method) & ~rows["censored"]]
        beyond = scored[scored["extended"]]
        assert table.loc[method, "us101-replay_extended_failures"] == beyond["failed"].sum()
        both = table.loc[method, ["us101-replay_logged_n", "us101-replay_extended_n"]]
        assert both.tolist() == [len(scored) - len(beyond), len(beyond)]


def test_the_page_of_the_docs_is_filled_from_the_folder(reproduced, tmp_path):
    results_page.main([str(reproduced), "--short", "--docs", str(tmp_path)])
    text = (tmp_path / "results.md").read_text(encoding="utf-8")
    table = pd.read_csv(reproduced / "tables" / "surrogate-failures.csv").set_index("method")
    block = text.partition("<!-- table: surrogate-failures ")[2].partition("<!-- end -->")[0]
    assert f"| acc | {table.loc['acc', 'us101-replay_failure_pct']:.2f} |" in block


def test_finished_studies_are_not_run_again(small, reproduced):
    before = (reproduced / DESIGNED / RESULTS).stat().st_mtime_ns
    run(small[:1], reproduced)
    assert (reproduced / DESIGNED / RESULTS).stat().st_mtime_ns == before


def test_every_claim_gets_a_verdict_with_figures(evidence):
    table = claims.claims_table(evidence).data
    assert len(table) == len(claims.CLAIMS)
    assert set(table["verdict"]) <= {claims.HOLDS, claims.FAILS, claims.OPEN}
    assert table["evidence"].str.contains(r"\d|no I-80").all()


def test_the_case_of_fig_3_is_behind_and_faster(small):
    case = cases.behind_but_accelerating(small[0])
    assert case.start == "host -85 m at 20.0 m/s, merging car -90 m at 15.0 m/s"
    assert set(case.failed) == set(cases.BEHIND_METHODS)
    lowest = case.lowest_acceleration()
    first = case.traces[(case.traces["method"] == "pgm") & (case.traces["host_station_m"] < 0)]
    assert lowest["pgm"] == first["host_acceleration_m_s2"].min()


def test_the_figure_of_nodes_has_a_line_per_method(evidence, tmp_path):
    (axes,) = figures.node_figure(evidence, looks(["pgm"])).axes
    (line,) = axes.lines
    assert line.get_xdata().tolist() == [1, 52, 80]
    with pytest.raises(UserError, match="no merging car of us101 in it"):
        figures.overlap_figure(tmp_path, site("us101"))


def _with_rates(evidence: Evidence, rates: dict[str, float]) -> Evidence:
    """The same evidence with other failure rates in every test."""
    summary = evidence.summary.copy()
    summary["failure_pct"] = summary["method"].map(rates).fillna(summary["failure_pct"])
    return replace(evidence, summary=summary)


@pytest.mark.parametrize(
    ("leads", "word"),
    [
        ([(1.0, 0.5, 2.0), (0.2, 0.1, 0.3)], claims.HOLDS),
        ([(1.0, 0.5, 2.0), (0.2, -0.1, 0.5)], claims.OPEN),
        ([(1.0, 0.5, 2.0), (-1.0, -2.0, -0.5)], claims.FAILS),
        ([(0.0, 0.0, 0.0)], claims.OPEN),
    ],
    ids=["all ahead", "one interval holds 0", "one behind", "tie"],
)
def test_a_verdict_needs_intervals_on_one_side(leads, word):
    assert claims._word(leads) == word


def test_a_grid_is_judged_by_the_range_over_models(evidence):
    same = {"scenario": "designed-2", "source": "designed", "car": "", "censored": False}
    cases = pd.DataFrame({"case": list("abcd")}).assign(**same)
    rows = [cases.assign(method="acc", failed=[True, True, False, False])]
    rows += [cases.assign(method="pgm", failed=[True, False, False, False])]
    by_model = pd.DataFrame({"method": "pgm", "model": ["m0", "m1", "m2"], "failure_pct": [0.0, 60.0, 25.0]})
    found = replace(evidence, results=pd.concat(rows), by_model=by_model).rate_difference("designed-2", "acc", "pgm")
    assert found == (25.0, -10.0, 50.0)


def test_the_curve_over_nodes_needs_a_lowest_middle(evidence):
    judge = claims.CLAIMS[2].judge
    for values, word in (
        ([3.0, 1.0, 2.0], claims.HOLDS),
        ([1.0, 1.0, 1.0], claims.OPEN),
        ([0.0, 1.0, 2.0], claims.FAILS),
    ):
        nodes = pd.DataFrame({"nodes": [1, 52, 80], "failure_pct": values})
        assert judge(replace(evidence, nodes=nodes)).word == word


def test_twice_as_often_is_counted(evidence):
    rates = {"fg-gmm": 1.0, "acc": 2.1, "slot": 2.1, "ipcb": 2.1, "pgm-g": 2.1}
    judge = claims.CLAIMS[6].judge
    assert judge(_with_rates(evidence, rates)).word == claims.HOLDS
    assert judge(_with_rates(evidence, rates | {"slot": 2.0})).word == claims.FAILS


def test_discordant_cases(evidence):
    rows = evidence.cases("designed-2").pivot(index="case", columns="method", values="failed").astype(bool)
    go, ipcb = rows["always-go"].to_numpy(), rows["ipcb"].to_numpy()
    found = evidence.discordant("designed-2", "always-go", "ipcb")
    assert found[:2] == (np.sum(go & ~ipcb), np.sum(~go & ipcb))


def test_the_studies_keep_sources_apart(tmp_path, data_dir, monkeypatch):
    monkeypatch.setattr(reproduction, "SPLITS", 2)
    found = studies(data_dir, tmp_path, jobs=1, seed=0)
    assert [study.name for study in found] == [
        "designed",
        "pairs-surrogate",
        "nodes-surrogate",
        "models-swept-surrogate",
        "pairs-ngsim",
        "nodes-ngsim",
        "models-swept-ngsim",
    ]
    real = found[4].request
    assert real.source == "ngsim"
    assert real.scenarios == ("us101-replay", "designed-1")
    assert real.settings == {"encounters.sites": {"us101": "test"}}
    assert (tmp_path / "models" / "us101-ngsim.json").is_file()


def test_two_folders_side_by_side(reproduced: Path, command: Callable[..., int], capsys, tmp_path):
    folders = (reproduced / "pairs-surrogate", reproduced / "nodes-surrogate")
    assert command("compare", *folders, "--out", tmp_path / "new") == 0
    printed = capsys.readouterr().out
    assert "pgm" in printed
    assert "only in" in printed
    table = pd.read_csv(tmp_path / "new" / "tables" / "comparison.csv")
    assert (table["failure_pct_a"] == table["failure_pct_b"]).all()
    assert (table[["only_a", "only_b"]] == 0).all(axis=None)
    assert (table["p"] == 1.0).all()
    assert command("compare", reproduced / "designed", folders[0]) == 2
    assert "no case of the same scenario and method in common" in capsys.readouterr().err

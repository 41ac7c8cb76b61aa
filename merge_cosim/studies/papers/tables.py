"""The papers' tables, ours beside theirs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from merge_cosim.core.encounter import Intention
from merge_cosim.core.units import FOOT
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.pairing.encounters import site_pairs
from merge_cosim.ngsim.pairing.summary import Summary, summarise, summarise_folder
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.ngsim.surrogate.recipe import RECIPES
from merge_cosim.ngsim.surrogate.surrogate import surrogate_folder
from merge_cosim.report.columns import Column, Table
from merge_cosim.report.methods import in_order
from merge_cosim.report.published import CYCLE_MS, PUBLISHED_MIXTURES, VALIDITY, Figure, published
from merge_cosim.report.tables import ranges
from merge_cosim.results.statistics.ensemble import ensemble
from merge_cosim.results.statistics.rates import wilson
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.studies.bounds import MOST_DELAY, bounds_of
from merge_cosim.studies.papers.evidence import Evidence
from merge_cosim.studies.reproduction import Study

TESTS = {
    "us101-replay": "US-101 replay",
    "i80-replay": "I-80 replay",
    "designed-1": "Designed Test I",
    "designed-2": "Designed Test II",
    "designed-3": "designed-3",
}
"""Headings of the tests; designed-3, drivers with a hidden intention, is ours."""
VALIDITY_STEPS = {"pgm-g": "without FG and GMM", "fg": "without GMM", "fg-gmm": "with both"}
"""Methods of the validity test, and what the paper calls them."""
VALIDITY_PAIRS = 100
"""Pairs per site in the validity test."""
METHOD = Column("method", "method")


def data_sets(source: str, data: Path | None) -> Table:
    """Features of the data sets (Dong, Dolan, Litkouhi 2017, Table I); without a data folder of the surrogate."""
    summaries = summarise_folder(data) if data else _surrogate_summaries()
    rows = [
        {
            "data": f"{one.site} ({source})",
            "pairs": one.pairs,
            "merge_distance_m": one.merge_distance_m,
            "speed_m_s": one.speed_m_s,
            "yielding_pct": 100 * one.yielding,
            "published_pairs": one.published.pairs if one.published else None,
            "published_merge_distance_m": one.published.merge_distance_m if one.published else None,
            "published_speed_m_s": one.published.speed_m_s if one.published else None,
        }
        for one in summaries
    ]
    columns = [
        Column("data", "data set"),
        Column("pairs", "pairs", 0, "ours"),
        Column("merge_distance_m", "L_merge m", 1, "ours"),
        Column("speed_m_s", "space-mean speed m/s", 1, "ours"),
        Column("yielding_pct", "yielding %", 0, "ours"),
        Column("published_pairs", "pairs", 0, "published"),
        Column("published_merge_distance_m", "L_merge m", 1, "published"),
        Column("published_speed_m_s", "space-mean speed m/s", 1, "published"),
    ]
    return Table.of(pd.DataFrame(rows), columns, "Features of the data sets")


def outcomes(evidence: Evidence) -> dict[str, Table]:
    """All methods in all tests (Dong, Dolan, Litkouhi 2017, Table II; Lyu, Dong, Dolan 2020, Table III)."""
    failures = _by_test(
        evidence,
        "Failures",
        [Column("failure_pct", "%", 2), Column("interval_pct", "95 %"), Column("host_not_reached", "never arrived", 0)],
        lambda figure: figure.failure_pct,
        counted=True,
    )
    distances = _by_test(
        evidence,
        "D, distance between the fronts when the host is at the merging point [m]",
        [Column("distance_m", "D", 1), Column("distance_interval_m", "95 %")],
        lambda figure: figure.distance_m,
    )
    costs = _by_test(
        evidence,
        "Delay against free driving [s], hardest braking [m/s²] and needless yields",
        [
            Column("delay_s", "delay", 2),
            Column("hardest_braking", "braking", 2),
            Column("unnecessary_yields", "needless", 0),
        ],
    )
    compared = _by_test(
        evidence,
        "Failures against pgm on the same cases (McNemar's exact test; a fixed grid has counts alone)",
        [
            Column("only_this_fails", "only this fails", 0),
            Column("only_other_fails", "only pgm fails", 0),
            Column("mcnemar_p", "p", 4, probability=True),
        ],
    )
    return {
        "failures": failures,
        "same-cases": compared,
        "distances": distances,
        "costs": costs,
        "over-models": over_models(evidence),
        "extended": extended(evidence),
        "time": _times(evidence),
    }


def extended(evidence: Evidence) -> Table:
    """Failures in the replays, apart for the pairs logged to the end and for those carried on beyond their log."""
    replays = [name for name in evidence.scenarios if load_scenario(name).is_replay]
    methods = in_order(evidence.results["method"].unique())
    data, columns = pd.DataFrame({"method": methods}), [METHOD]
    for scenario in replays:
        rows = evidence.cases(scenario)
        for name, beyond in (("logged to the end", False), ("carried on", True)):
            scored = rows[~rows["censored"] & (rows["extended"] == beyond)]
            failed = scored.groupby("method")["failed"].agg(["size", "sum"]).reindex(methods, fill_value=0)
            low, high = zip(*(wilson(int(part), int(n)) for n, part in failed.to_numpy()), strict=True)
            key, group = f"{scenario}_{'extended' if beyond else 'logged'}", f"{TESTS[scenario]}, {name}"
            data[f"{key}_n"], data[f"{key}_failures"] = failed["size"].to_numpy(), failed["sum"].to_numpy()
            data[f"{key}_interval_pct"] = ranges(pd.Series(low, dtype=float), pd.Series(high, dtype=float))
            columns += [
                Column(f"{key}_n", "pairs", 0, group),
                Column(f"{key}_failures", "failed", 0, group),
                Column(f"{key}_interval_pct", "95 %", None, group, range=True),
            ]
    title = "Failures of pairs logged to the end of scoring, and of pairs carried on at their last speed"
    return Table.of(data, columns, title)


def over_models(evidence: Evidence) -> Table:
    """Designed Test II with each model of the ensemble: median and range over models."""
    rows = ensemble(evidence.by_model).set_index("method")
    rows = rows.loc[in_order(rows.index)].reset_index()
    columns = [METHOD, Column("models", "models", 0)]
    for name, group in (
        ("failure_pct", "failed %"),
        ("failed_or_stuck_pct", "failed or stuck %"),
        ("delay_s", "delay s"),
    ):
        columns += [Column(f"{name}_{what}", what, 2, group) for what in ("median", "min", "max")]
    title = "Designed Test II with models that were each trained on another third of the merging cars"
    return Table.of(rows, columns, title)


def bounds(study: Study) -> Table:
    """How many cases of each replay no host could pass, or not without a long delay."""
    request = study.request
    rows = [
        row
        for scenario in map(str, request.scenarios)
        if load_scenario(scenario).is_replay
        for row in bounds_of(scenario, request.settings, request.data, request.source, search=None)[1]
    ]
    columns = [
        Column("scenario", "test"),
        Column("n", "pairs", 0),
        Column("infeasible", "infeasible", 0),
        Column("infeasible_in_time", f"infeasible within {MOST_DELAY:g} s of free driving", 0),
        Column("min_delay_s", "mean of the smallest delays s", 2),
    ]
    return Table.of(pd.DataFrame(rows), columns, "What any host could have done")


def _by_test(
    evidence: Evidence,
    title: str,
    measures: Sequence[Column],
    theirs: Callable[[Figure], float | None] | None = None,
    counted: bool = False,
) -> Table:
    """Methods in rows, a group of columns per test."""
    tests = {name: evidence.outcome(name) for name in evidence.scenarios}
    methods = in_order(set().union(*(set(rows.index) for rows in tests.values())))
    data, columns = pd.DataFrame({"method": methods}), [METHOD]
    for name, rows in tests.items():
        found = rows.reindex(methods)
        group = f"{TESTS[name]}, n = {int(rows['n'].max()):,}" if counted else TESTS[name]
        for measure in measures:
            data[f"{name}_{measure.name}"] = found[measure.name].to_numpy()
            columns.append(Column(f"{name}_{measure.name}", measure.heading, measure.decimals, group))
        if theirs:
            figures = [published(name, method) for method in methods]
            data[f"{name}_published"] = np.array([theirs(one) if one else None for one in figures], dtype=float)
            columns.append(Column(f"{name}_published", "published", 1, group))
    return Table.of(data, columns, title)


def _times(evidence: Evidence) -> Table:
    rows = evidence.outcome(evidence.scenarios[0])
    methods = in_order(rows.index[rows["cycle_us_single"].notna()])
    data = rows.loc[methods, ["cycle_us", "cycle_us_single"]].reset_index()
    data["published"] = [1000 * CYCLE_MS.get(method, np.nan) for method in methods]
    columns = [
        METHOD,
        Column("cycle_us", "in a full batch", 2, "µs per update"),
        Column("cycle_us_single", "alone", 1, "µs per update"),
        Column("published", "published", 0, "µs per update"),
    ]
    return Table.of(data, columns, "Time of one update")


def validity(evidence: Evidence) -> Table:
    """Failures without FG and GMM, without GMM, and with both (Lyu, Dong, Dolan 2020, Table II)."""
    rows = []
    for scenario, theirs in VALIDITY.items():
        cases = evidence.cases(scenario)
        if cases.empty:
            continue
        chosen = sorted(cases["case"].unique())[:VALIDITY_PAIRS]
        row: dict[str, object] = {"data": TESTS[scenario].removesuffix(" replay"), "pairs": len(chosen)}
        for method in VALIDITY_STEPS:
            of_method = cases[(cases["method"] == method) & cases["case"].isin(chosen) & ~cases["censored"]]
            row[f"{method}_n"], row[f"{method}_pct"] = len(of_method), 100 * of_method["failed"].mean()
            row[f"{method}_published_pct"] = theirs[method]
        rows.append(row)
    columns = [Column("data", "data set"), Column("pairs", "pairs", 0)]
    for method, title in VALIDITY_STEPS.items():
        group = f"{title} ({method})"
        columns += [
            Column(f"{method}_n", "scored", 0, group),
            Column(f"{method}_pct", "%", 1, group),
            Column(f"{method}_published_pct", "published %", 0, group),
        ]
    return Table.of(pd.DataFrame(rows), columns, "Validity of FG and GMM")


def nodes(evidence: Evidence) -> Table:
    """Failures by number of speed nodes."""
    data = evidence.nodes[["nodes", "n", "failures", "failure_pct", "interval_pct", "decision_flips", "delay_s"]]
    columns = [
        Column("nodes", "nodes", 0),
        Column("n", "n", 0),
        Column("failures", "failures", 0),
        Column("failure_pct", "%", 2),
        Column("interval_pct", "95 %"),
        Column("decision_flips", "flips", 2),
        Column("delay_s", "delay s", 2),
    ]
    return Table.of(data, columns, "PGM by its number of speed nodes, us101-replay")


def beliefs(evidence: Evidence) -> dict[str, Table]:
    """Accuracy, AUC, Brier score and log loss of the closed loop by distance, one table per test with labels."""
    found = {}
    for (scenario, site), rows in evidence.beliefs.groupby(["scenario", "site"]):
        methods = in_order(rows["method"])
        data, columns = pd.DataFrame({"method": methods}), [METHOD]
        for gate, part in sorted(rows.groupby("gate_m"), reverse=True):
            at = part.set_index("method").reindex(methods)
            for name, heading, decimals in (
                ("n", "n", 0), ("accuracy_pct", "right %", 1), ("auc", "AUC", 3), ("brier", "Brier", 3),
                ("log_loss", "log loss", 3),
            ):  # fmt: skip
                data[f"{name}_{gate}"] = at[name].to_numpy(dtype=float)
                columns.append(Column(f"{name}_{gate}", heading, decimals, f"at {gate} m"))
        found[f"beliefs-{scenario}-{site}"] = Table.of(data, columns, f"{TESTS[str(scenario)]}: beliefs")
    return found


def mixture(model: IntentionModel) -> Table:
    """Parameters of the speed mixtures at lag 1 beside the published ones (Lyu, Dong, Dolan 2020, Table I).

    The variance of V_t was not published.
    """
    ours = model.speed(1).mixture
    rows = []
    for intention in (Intention.YIELD, Intention.NOT_YIELD):
        pairs = zip(("slow", "fast"), PUBLISHED_MIXTURES[intention.name], strict=True)
        for k, (component, paper) in enumerate(pairs):  # both are ordered by their mean
            mean, covariance = ours.means[intention, k] / FOOT, ours.covariances[intention, k] / FOOT**2
            both: dict[str, tuple[float, float | None]] = {
                "weight": (ours.weights[intention, k], paper.weight),
                "mean of V_{t-1} [ft/s]": (mean[0], paper.mean_before),
                "mean of V_t [ft/s]": (mean[1], paper.mean_now),
                "variance of V_{t-1} [ft^2/s^2]": (covariance[0, 0], paper.variance),
                "covariance [ft^2/s^2]": (covariance[0, 1], paper.covariance),
                "variance of V_t [ft^2/s^2]": (covariance[1, 1], None),
            }
            rows += [
                (intention.name, component, name, round(float(own), 4), theirs) for name, (own, theirs) in both.items()
            ]
    columns = [
        Column("intention", "intention"),
        Column("component", "component"),
        Column("parameter", "parameter"),
        Column("ours", "ours", 2),
        Column("published", "published", 2),
    ]
    data = pd.DataFrame(rows, columns=[column.name for column in columns])
    return Table.of(data, columns, "Mixture of speed transitions, in ft/s; components matched by their mean speed")


def _surrogate_summaries() -> list[Summary]:
    found = []
    for site in map(find_site, RECIPES):
        pairs = site_pairs(surrogate_folder(site), site, source="surrogate")
        assert pairs is not None
        found.append(summarise(pairs, site.name, "surrogate"))
    return found

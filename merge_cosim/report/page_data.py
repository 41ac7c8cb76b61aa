"""What the scripts of the page draw, as plain JSON values: trade-off, failure maps, delays, beliefs, variations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from merge_cosim.report.failure_shares import failure_shares
from merge_cosim.report.methods import Look, in_order
from merge_cosim.results.statistics import belief, calibration
from merge_cosim.results.statistics.rates import MOST_CLUSTERS, bootstrap_means
from merge_cosim.results.statistics.summary import ALL_STARTS, AMBIGUITY_EDGES, is_sample
from merge_cosim.results.statistics.verdict import Verdict
from merge_cosim.scenarios.methods import is_reference

MOST_DOTS = 1_500
"""Cases of a sample whose delays are drawn; of more, every k-th and all that failed."""
MEASURED = ["failures", "stuck", "failure_pct", "failed_or_stuck_pct", "delay_s", "distance_m"]
CALIBRATED_AT = 40
"""Distance of the merging car [m] at which calibration is drawn."""


def method_looks(looks: Mapping[str, Look]) -> dict[str, Any]:
    """Colour, shape and dashes of each method, and whether it is a reference, which is drawn hollow."""
    return {
        name: {"color": look.color, "mark": look.mark, "dash": look.dash, "reference": is_reference(name)}
        for name, look in ((name, looks[name]) for name in in_order(looks))
    }


def outcome_rows(summary: pd.DataFrame, rows: pd.DataFrame, verdict: Verdict) -> list[dict[str, Any]]:
    """One entry per method, the best first and references last: the numbers of the chart and of the short table.

    Of a method with several models the median, and the range in place of the intervals.
    """
    found = []
    for method in in_order(map(str, summary["method"])):
        own = summary[summary["method"] == method]
        middle = own[MEASURED].apply(pd.to_numeric).median()
        bad_low, bad_high = own["failed_or_stuck_low_pct"].iloc[0], own["failed_or_stuck_high_pct"].iloc[0]
        failed_low, failed_high = own["ci_low_pct"].iloc[0], own["ci_high_pct"].iloc[0]
        delay_low, delay_high = _delay_interval(rows[rows["method"] == method])
        if len(own) > 1:  # the range over models in place of the interval over cases
            bad_low, bad_high = own["failed_or_stuck_pct"].min(), own["failed_or_stuck_pct"].max()
            failed_low, failed_high = own["failure_pct"].min(), own["failure_pct"].max()
            delay_low, delay_high = own["delay_s"].min(), own["delay_s"].max()
        found.append(
            {
                "method": method,
                "reference": is_reference(method),
                "best": method in verdict.best and len(verdict.best) < len(verdict.order),
                "undecided": method in verdict.undecided and method not in verdict.best,
                "models": len(own),
                "n": int(own["n"].iloc[0]),
                "failed": round(middle["failures"]),
                "stuck": round(middle["stuck"]),
                "failed_pct": number(middle["failure_pct"]),
                "failed_low": number(failed_low),
                "failed_high": number(failed_high),
                "bad_pct": number(middle["failed_or_stuck_pct"]),
                "bad_low": number(bad_low),
                "bad_high": number(bad_high),
                "delay": number(middle["delay_s"], 6),
                "delay_low": number(delay_low, 6),
                "delay_high": number(delay_high, 6),
                "distance": number(middle["distance_m"], 6),
            }
        )
    order = {method: place for place, method in enumerate(verdict.order)}
    return sorted(
        found,
        key=lambda one: (
            one["reference"],
            order.get(one["method"], len(order)),
            math.inf if one["bad_pct"] is None else one["bad_pct"],
        ),
    )


def map_data(rows: pd.DataFrame) -> dict[str, Any]:
    """Failure maps: the speeds of both axes, and for each method its failed, absent and all cases of every cell.

    The cells of a method are a flat list, merging speeds first.
    """
    shares = failure_shares(rows)
    return {
        "hosts": shares.hosts.tolist(),
        "mergings": shares.mergings.tolist(),
        "failed": {method: counts.ravel().tolist() for method, counts in shares.failed.items()},
        "absent": {method: counts.ravel().tolist() for method, counts in shares.absent.items()},
        "n": {method: counts.ravel().tolist() for method, counts in shares.n.items()},
    }


def delay_data(rows: pd.DataFrame) -> dict[str, Any]:
    """Delay of each case against how ambiguous its start was, by method, with what failed."""
    cases = rows.drop_duplicates("case")
    step = -(-len(cases) // MOST_DOTS)
    kept = set(cases["case"].iloc[::step]) | set(rows.loc[rows["failed"], "case"].iloc[:MOST_DOTS])
    shown = rows[rows["case"].isin(kept)]
    return {
        "edges": [edge for edge in AMBIGUITY_EDGES[1:] if math.isfinite(edge)],
        "shown": len(kept),
        "all": len(cases),
        "methods": {
            method: {
                "x": shown.loc[own, "ambiguity_s"].round(2).tolist(),
                "y": [number(value, 2) for value in shown.loc[own, "delay_s"]],
                "failed": shown.loc[own, "failed"].astype(int).tolist(),
            }
            for method in in_order(shown["method"])
            for own in [shown["method"] == method]
        },
    }


def belief_data(rows: pd.DataFrame, site: str) -> dict[str, Any] | None:
    """Share of right decisions by distance, and calibration at one distance; None where no case has a label."""
    found = belief(rows)
    if not len(found):
        return None
    right = _of_site(found[found["start"] == ALL_STARTS], site)
    sure = calibration(rows)
    sure = _of_site(sure[sure["gate_m"] == CALIBRATED_AT], site) if len(sure) else sure
    return {
        "at": CALIBRATED_AT,
        "right": [
            {"name": method, "x": part["gate_m"].tolist(), "y": part["accuracy_pct"].tolist()}
            for method, part in _by_method(right)
        ],
        "calibration": [
            {
                "name": method,
                "x": (100 * part["mean_belief"]).round(2).tolist(),
                "y": (100 * part["not_yield_share"]).round(2).tolist(),
                "n": part["n"].tolist(),
            }
            for method, part in _by_method(sure)
        ],
    }


def variation_data(summary: pd.DataFrame, scenario: str, parameter: str) -> list[dict[str, Any]]:
    """Failures by the values of a varied parameter: a plot per source and site, a series per method."""
    rows = summary[summary["scenario"] == scenario]
    rows = rows.assign(value=rows["variation"].str.partition("=")[2])
    varied = rows[rows["variation"].str.startswith(f"{parameter}=")]
    plots = []
    for (source, site), part in varied.groupby(["source", "site"]):
        values = part["value"].drop_duplicates().tolist()
        numbers = pd.to_numeric(pd.Series(values), errors="coerce")
        scale = bool(numbers.notna().all())
        series = []
        for method, own in _by_method(part):
            place = own["value"].map(dict(zip(values, numbers if scale else range(len(values)), strict=True)))
            own = own.assign(place=place.astype(float)).sort_values("place")
            series.append(
                {
                    "name": method,
                    "x": own["place"].tolist(),
                    "y": [number(value) for value in own["failure_pct"]],
                    "low": [number(value) for value in own["ci_low_pct"]],
                    "high": [number(value) for value in own["ci_high_pct"]],
                }
            )
        plots.append(
            {"source": source, "site": site, "parameter": parameter, "series": series}
            | {"values": [] if scale else values}
        )
    return plots


def number(value: Any, decimals: int = 4) -> float | None:
    """A number for JSON; None where it is missing."""
    return None if value is None or pd.isna(value) else round(float(value), decimals)


def _delay_interval(rows: pd.DataFrame) -> tuple[float | None, float | None]:
    if not len(rows) or not is_sample(rows):
        return None, None
    if bool((rows["car"] != "").all()):
        return bootstrap_means(rows[["delay_s"]], rows["car"])[0]
    case = rows["case"]  # sorted by it; where each is there once, there is nothing to sum up by case
    once = len(case) > MOST_CLUSTERS and not case.eq(case.shift()).any()
    return bootstrap_means(rows[["delay_s"]], None if once else case)[0]


def _by_method(frame: pd.DataFrame) -> Iterable[tuple[str, pd.DataFrame]]:
    parts = dict(list(frame.groupby("method"))) if len(frame) else {}
    return [(method, parts[method]) for method in in_order(map(str, parts))]


def _of_site(frame: pd.DataFrame, site: str) -> pd.DataFrame:
    return frame[(frame["site"] == site) | (frame["site"].nunique() == 1)]

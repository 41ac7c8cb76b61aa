"""Methods that were run with several learned models: median and range over models, and how often one beats another."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import pandas as pd

from merge_cosim.results.statistics.rates import percent

SECTION = ["scenario", "variation", "site", "source"]
MEASURES = ("failure_pct", "failed_or_stuck_pct", "delay_s", "distance_m")
"""Measures of the summary whose median and range over models are given."""
RANK = "failed_or_stuck_pct"
"""The measure by which a method beats another: less is better."""


def ensemble(summary: pd.DataFrame) -> pd.DataFrame:
    """One row per section and method that was run with several models.

    `models`; `n`, `failures` and `failure_pct` over all models together; `M_median`, `M_min` and `M_max` over models of
    each measure M.
    """
    found = []
    for key, rows in summary[summary["model"] != ""].groupby([*SECTION, "method"], sort=True):
        if len(rows) > 1:
            found.append(dict(zip([*SECTION, "method"], key, strict=True)) | _over_models(rows))
    return pd.DataFrame(found)


def _over_models(rows: pd.DataFrame) -> dict[str, Any]:
    n, failures = int(rows["n"].sum()), int(rows["failures"].sum())
    spread = {
        f"{name}_{what}": round(float(getattr(rows[name], what)()), 4)
        for name in MEASURES
        for what in ("median", "min", "max")
    }
    return {"models": len(rows), "n": n, "failures": failures, "failure_pct": percent(failures, n), **spread}


def rivals(summary: pd.DataFrame) -> pd.DataFrame:
    """For every two methods of a section, at least one of them with several models: how often one beats the other.

    `models`: the models that both were run with; a method without a model counts with each. `first_better`, `equal`,
    `second_better`: in how many of them.
    """
    found = []
    for key, section in summary.groupby(SECTION, sort=True):
        by_method = {name: rows.set_index("model")[RANK] for name, rows in section.groupby("method", sort=True)}
        for first, second in combinations(by_method, 2):
            one, other = by_method[first], by_method[second]
            if max(len(one), len(other)) < 2:
                continue
            if "" in one.index:
                one = pd.Series(one.iloc[0], index=other.index)
            if "" in other.index:
                other = pd.Series(other.iloc[0], index=one.index)
            both = one.index.intersection(other.index)
            gap = one[both] - other[both]
            found.append(
                dict(zip(SECTION, key, strict=True))
                | {"first": first, "second": second, "models": len(both)}
                | {"first_better": int((gap < 0).sum()), "equal": int((gap == 0).sum())}
                | {"second_better": int((gap > 0).sum())}
            )
    return pd.DataFrame(found)

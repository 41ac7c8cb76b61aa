"""Statistics over result rows: the rows of `oracle-best`, and one summary row per scenario and method."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from merge_cosim.experiments.methods import CONSTANT, ORACLE_BEST
from merge_cosim.experiments.outcome import SCHEMA

CASE = ["scenario", "variation", "source", "site", "case"]
GROUP = ["scenario", "variation", "site", "source", "method", "model"]
D0 = 2.0
"""A host that lets the merging car pass without need kept at least this bumper gap [m] (d0 of the controller)."""


def oracle_best(rows: pa.Table) -> pa.Table:
    """Rows of the better of always-go and always-yield on each case: the one that does not fail, ties by delay.

    It bounds what constant decisions can reach, no more. Empty where one of the two was not run.
    """
    frame = rows.to_pandas()
    frame = frame[frame["method"].isin(CONSTANT)]
    frame = frame.sort_values([*CASE, "failed", "delay_s", "method"], kind="stable")
    both = frame.groupby(CASE)["method"].transform("nunique") == len(CONSTANT)
    best = frame[both].drop_duplicates(CASE).assign(method=ORACLE_BEST)
    return pa.Table.from_pandas(best, schema=SCHEMA, preserve_index=False)


def summarise(rows: pa.Table, cycle_us: Mapping[str, tuple[float, float | None]]) -> pd.DataFrame:
    """One row per (scenario, variation, site, source, method), in the order of the method's failure rate.

    A scenario with several sites also gets a row over all of them where they have the same source (site `all`).

    Args:
        rows: Result rows.
        cycle_us: For each method the time of one update per encounter in a full batch, and in a batch of one [us].
    """
    frame = rows.to_pandas()
    frame["unnecessary_yield"] = _unnecessary_yields(frame)
    parts = [frame]
    for _, scenario in frame.groupby("scenario", sort=False):
        if scenario["site"].nunique() > 1 and scenario["source"].nunique() == 1:
            parts.append(scenario.assign(site="all"))
    grouped = pd.concat(parts).groupby(GROUP, sort=True)
    return pd.DataFrame([_summary(dict(zip(GROUP, key, strict=True)), group, cycle_us) for key, group in grouped])


def _summary(
    key: dict[str, str], group: pd.DataFrame, cycle_us: Mapping[str, tuple[float, float | None]]
) -> dict[str, Any]:
    scored = group[~group["censored"]]
    failures, n = int(scored["failed"].sum()), len(scored)
    censored = len(group) - n
    sample = key["source"] != "designed"  # a fixed grid is no sample
    low, high = _wilson(failures, n) if sample and n else (None, None)
    batch_us, single_us = cycle_us.get(key["method"], (None, None))
    own = scored[scored["failure_kind"] != "merging_into_host"]
    return {
        **key,
        "n": n,
        "failures": failures,
        "failure_pct": _percent(failures, n),
        "ci_low_pct": low,
        "ci_high_pct": high,
        "failure_pct_own": _percent(int(own["failed"].sum()), len(own)),
        "censored": censored,
        "failure_pct_best": _percent(failures, len(group)),
        "failure_pct_worst": _percent(failures + censored, len(group)),
        "extended": int(group["extended"].sum()),
        "host_not_reached": int((~group["host_reached"]).sum()),
        "host_first_pct": _mean(group["host_first"], 100),
        "distance_m": _mean(group["distance_m"]),
        "distance_m_safe": _mean(group.loc[~group["failed"], "distance_m"]),
        "gap_m": _mean(group["gap_m"]),
        "delay_s": _mean(group["delay_s"]),
        "hardest_braking": _mean(group["hardest_braking"]),
        "hardest_braking_p95": _quantile(group["hardest_braking"], 0.95),
        "min_ttc_s_p05": _quantile(group["min_ttc_s"], 0.05),
        "unnecessary_yields": _count(group["unnecessary_yield"]),
        "decision_flips": _mean(group["decision_flips"]),
        "correct_at_merge_pct": _mean(group["correct_at_merge"], 100),
        "order_swapped": _count(group["order_swapped"]),
        "sumo_disagrees": int((group["sumo_collision"] != group["failed"]).sum()),
        "cycle_us": None if batch_us is None else round(batch_us, 3),
        "cycle_us_single": None if single_us is None else round(single_us, 3),
    }


def _unnecessary_yields(frame: pd.DataFrame) -> pd.Series:
    """The host passes second though always-go passes first on that case, without failure and with gap >= d0.

    Missing where always-go was not run.
    """
    go = frame[frame["method"] == "always-go"].drop_duplicates(CASE)
    possible = (go["host_first"] == True) & ~go["failed"] & (go["gap_m"].fillna(np.inf) >= D0)  # noqa: E712 - may be missing
    known = frame[CASE].merge(go[CASE].assign(possible=possible.astype("boolean")), how="left", on=CASE)["possible"]
    known = known.set_axis(frame.index)
    passed_second = (frame["host_first"] == False).to_numpy(dtype=bool)  # noqa: E712 - may be missing
    return (known & passed_second).where(known.notna())


def _wilson(failures: int, n: int) -> tuple[float, float]:
    from scipy.stats import binomtest  # half a second to import, which a worker process need not pay

    interval = binomtest(failures, n).proportion_ci(method="wilson")
    return round(100 * interval.low, 4), round(100 * interval.high, 4)


def _percent(part: int, whole: int) -> float | None:
    return round(100 * part / whole, 4) if whole else None


def _mean(values: pd.Series, factor: float = 1.0) -> float | None:
    present = values.dropna().astype(float)
    return round(factor * float(present.mean()), 6) if len(present) else None


def _quantile(values: pd.Series, q: float) -> float | None:
    present = values.dropna()
    return round(float(present.quantile(q)), 6) if len(present) else None


def _count(values: pd.Series) -> int | None:
    present = values.dropna()
    return int(present.sum()) if len(present) else None

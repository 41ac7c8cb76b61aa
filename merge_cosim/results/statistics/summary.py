"""Statistics over result rows: the rows of `oracle-best`, and one summary row per scenario and method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from merge_cosim.results.schema import SCHEMA
from merge_cosim.results.statistics.comparison import compare
from merge_cosim.results.statistics.paired import holm
from merge_cosim.results.statistics.rates import bootstrap_means, count, mean, percent, quantile, wilson
from merge_cosim.scenarios.methods import CONSTANT, ORACLE_BEST
from merge_cosim.simulation.worlds.traffic import TRAFFIC

CASE = ["scenario", "variation", "source", "site", "case"]
GROUP = ["scenario", "variation", "site", "source", "method", "model"]
SECTION = ["scenario", "variation", "site", "source"]
ALL_SITES = "all"
AMBIGUITY_EDGES = (0.0, 1.0, 3.0, np.inf)
"""Strata of |T_m - T_h| at the start [s]."""
ALL_STARTS = "all"
D0 = 2.0
"""A host that lets the merging car pass without need kept at least this bumper gap [m] (d0 of the controller)."""


def oracle_best(rows: pa.Table) -> pa.Table:
    """Rows of the better of always-go and always-yield on each case: the one that does not fail, ties by delay.

    It bounds what constant decisions can reach, no more. Empty where one of the two was not run, and in living traffic.
    """
    frame = rows.to_pandas()
    frame = frame[frame["method"].isin(CONSTANT) & (frame["source"] != TRAFFIC)]
    frame = frame.sort_values([*CASE, "failed", "delay_s", "method"], kind="stable")
    both = frame.groupby(CASE)["method"].transform("nunique") == len(CONSTANT)
    best = frame[both].drop_duplicates(CASE).assign(method=ORACLE_BEST)
    return pa.Table.from_pandas(best, schema=SCHEMA, preserve_index=False)


def summarise(
    rows: pd.DataFrame, cycle_us: Mapping[str, tuple[float, float | None]], against: str | None = None
) -> pd.DataFrame:
    """One row per (scenario, variation, site, source, method), sorted by them.

    A scenario with several sites also gets a row over all of them where they have the same source (site `all`).

    Args:
        rows: Result rows, as pandas reads them.
        cycle_us: For each method the time of one update per encounter in a full batch, and in a batch of one [us].
        against: Method that the others are compared with on the same cases; None for none.
    """
    return _summaries(_with_yields(rows), cycle_us, against)


def strata(rows: pd.DataFrame, against: str | None = None) -> pd.DataFrame:
    """The same for the cases of each ambiguity at the start, with the column `start`; variations are left out."""
    frame = _with_yields(rows)
    parts = by_start(frame[frame["variation"] == ""])
    found = [_summaries(part, {}, against).assign(start=start) for start, part in parts if len(part)]
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame()


def by_start(frame: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Part rows by how ambiguous their cases begin."""
    for low, high in pairwise(AMBIGUITY_EDGES):
        name = f"[{low:g}, {high:g}) s" if np.isfinite(high) else f">= {low:g} s"
        yield name, frame[(frame["ambiguity_s"] >= low) & (frame["ambiguity_s"] < high)]


def with_all_sites(frame: pd.DataFrame) -> pd.DataFrame:
    """Add each row of a scenario with several sites of one source once more, under the site `all`."""
    parts = [frame]
    for _, scenario in frame.groupby("scenario", sort=False):
        if scenario["site"].nunique() > 1 and scenario["source"].nunique() == 1:
            parts.append(scenario.assign(site=ALL_SITES))
    return pd.concat(parts)


def compare_all(rows: pd.DataFrame, against: str | None) -> dict[tuple[str, ...], dict[str, Any]]:
    """The comparison of every group (`GROUP`) with a method on the same cases."""
    frame = with_all_sites(rows)
    others = {tuple(map(str, key)): part for key, part in frame[frame["method"] == against].groupby(SECTION)}
    found = {}
    for names, group in frame.groupby(GROUP, sort=True):
        key = tuple(map(str, names))
        in_common = key[: len(SECTION)] if key[SECTION.index("source")] != TRAFFIC else ()
        other = others.get(in_common, frame.iloc[:0])
        same_model = other["model"] == key[GROUP.index("model")]
        other = (other[same_model] if same_model.any() else other).drop_duplicates("case")
        found[key] = compare(group, other, against, is_sample(group))
    return found


def _summaries(
    frame: pd.DataFrame, cycle_us: Mapping[str, tuple[float, float | None]], against: str | None
) -> pd.DataFrame:
    compared = compare_all(frame, against)
    groups = with_all_sites(frame).groupby(GROUP, sort=True)
    found = []
    for names, group in groups:
        key = tuple(map(str, names))
        found.append(_summary(dict(zip(GROUP, key, strict=True)), group, cycle_us) | compared[key])
    table = pd.DataFrame(found)
    table["p_holm"] = np.nan
    for _, section in table[table["mcnemar_p"].notna()].groupby(SECTION):
        table.loc[section.index, "p_holm"] = holm(section["mcnemar_p"].tolist())
    return table


def is_sample(group: pd.DataFrame) -> bool:
    """A fixed grid is no sample."""
    return bool((group["source"] != "designed").all())


def _summary(
    key: dict[str, str], group: pd.DataFrame, cycle_us: Mapping[str, tuple[float, float | None]]
) -> dict[str, Any]:
    scored = group[~group["censored"]]
    failures, n = int(scored["failed"].sum()), len(scored)
    censored = len(group) - n
    stuck = int(scored["stuck"].sum())
    low, high = wilson(failures, n) if is_sample(group) else (None, None)
    stuck_low, stuck_high = wilson(failures + stuck, n) if is_sample(group) else (None, None)
    batch_us, single_us = cycle_us.get(key["method"], (None, None))
    own = scored[scored["failure_kind"] != "merging_into_host"]
    labelled = group[group["correct_at_merge"].notna()]
    return {
        **key,
        "n": n,
        "failures": failures,
        "failure_pct": percent(failures, n),
        "ci_low_pct": low,
        "ci_high_pct": high,
        **_intervals(group),
        "failure_pct_own": percent(int(own["failed"].sum()), len(own)),
        "censored": censored,
        "failure_pct_best": percent(failures, len(group)),
        "failure_pct_worst": percent(failures + censored, len(group)),
        "stuck": stuck,
        "deadlocks": int(scored["deadlock"].sum()),
        "outside_support": None if group["in_support"].isna().all() else int((~group["in_support"].astype(bool)).sum()),
        "failed_or_stuck_pct": percent(failures + stuck, n),
        "failed_or_stuck_low_pct": stuck_low,
        "failed_or_stuck_high_pct": stuck_high,
        "failed_or_stuck_pct_worst": percent(failures + stuck + censored, len(group)),
        "extended": int(group["extended"].sum()),
        "host_not_reached": int((~group["host_reached"]).sum()),
        "host_first_pct": mean(group["host_first"], 100),
        "distance_m": mean(group["distance_m"]),
        "distance_m_safe": mean(group.loc[~group["failed"], "distance_m"]),
        "gap_m": mean(group["gap_m"]),
        "delay_s": mean(group["delay_s"]),
        "hardest_braking": mean(group["hardest_braking"]),
        "hardest_braking_p95": quantile(group["hardest_braking"], 0.95),
        "mean_jerk": mean(group["mean_jerk"]),
        "min_ttc_s_p05": quantile(group["min_ttc_s"], 0.05),
        "max_drac_p95": quantile(group["max_drac"], 0.95),
        "pet_s_p05": quantile(group["pet_s"], 0.05),
        "min_leader_gap_m_p05": quantile(group["min_leader_gap_m"], 0.05),
        "min_leader_ttc_s_p05": quantile(group["min_leader_ttc_s"], 0.05),
        "min_follower_gap_m_p05": quantile(group["min_follower_gap_m"], 0.05),
        "merging_stopped": count(group["merging_stopped"]),
        "unnecessary_yields": count(group["unnecessary_yield"]),
        "labelled": len(labelled),
        "decision_flips": mean(group["decision_flips"]),
        "correct_at_merge_pct": mean(group["correct_at_merge"], 100),
        "first_stable_pct": percent(int(labelled["first_stable_s"].notna().sum()), len(labelled)),
        "first_stable_s": mean(labelled["first_stable_s"]),
        "order_swapped": count(group["order_swapped"]),
        "human_station_rms_m": mean(group["human_station_rms_m"]),
        "human_speed_rms": mean(group["human_speed_rms"]),
        "sumo_disagrees": int((group["sumo_collision"] != group["failed"]).sum()),
        "cycle_us": None if batch_us is None else round(batch_us, 3),
        "cycle_us_single": None if single_us is None else round(single_us, 3),
    }


def _intervals(group: pd.DataFrame) -> dict[str, Any]:
    """Bootstrap intervals over merging cars: of the failure rate where a car has several cases, and of D."""
    names = ("cluster_low_pct", "cluster_high_pct", "distance_low_m", "distance_high_m")
    if not is_sample(group):
        return {"cars": None, **dict.fromkeys(names)}
    logged = bool((group["car"] != "").all())
    clusters = group["car"] if logged else group["case"]
    several = clusters.nunique() < len(group)
    failed = (100.0 * group["failed"]).where(~group["censored"])
    values = pd.DataFrame({"failed": failed, "distance": group["distance_m"]})
    rate, distance = bootstrap_means(values, clusters)
    if not several:
        rate = (None, None)
    ends = (None if end is None else round(end, 4) for end in (*rate, *distance))
    return {"cars": clusters.nunique() if logged else None, **dict(zip(names, ends, strict=True))}


def _with_yields(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(unnecessary_yield=_unnecessary_yields(rows))


def _unnecessary_yields(frame: pd.DataFrame) -> pd.Series:
    """The host passes second though always-go passes first on that case, without failure and with gap >= d0.

    Missing where always-go was not run.
    """
    go = frame[(frame["method"] == "always-go") & (frame["source"] != TRAFFIC)].drop_duplicates(CASE)
    possible = go["host_first"].eq(True) & ~go["failed"] & (go["gap_m"].fillna(np.inf) >= D0)
    known = frame[CASE].merge(go[CASE].assign(possible=possible.astype("boolean")), how="left", on=CASE)["possible"]
    known = known.set_axis(frame.index)
    passed_second = frame["host_first"].eq(False).to_numpy(dtype=bool)
    return (known & passed_second).where(known.notna())

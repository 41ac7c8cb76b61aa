"""Statistics over result rows: the rows of `oracle-best`, and one summary row per scenario and method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any, Self

import numpy as np
import pandas as pd
import pyarrow as pa

from merge_cosim.core.units import BoolArray, FloatArray, IntArray
from merge_cosim.results.schema import SCHEMA
from merge_cosim.results.statistics.arrays import RowArrays
from merge_cosim.results.statistics.comparison import disagreement, judged, not_compared
from merge_cosim.results.statistics.paired import holm
from merge_cosim.results.statistics.rates import percent, wilson
from merge_cosim.results.statistics.totals import Sum, Tail, Totals
from merge_cosim.scenarios.methods import CONSTANT, ORACLE_BEST
from merge_cosim.simulation.worlds.traffic import TRAFFIC

CASE = ["scenario", "variation", "source", "site", "case"]
GROUP = ["scenario", "variation", "site", "source", "method", "model"]
SECTION = ["scenario", "variation", "site", "source"]
ALL_SITES = "all"
AMBIGUITY_EDGES = (0.0, 1.0, 3.0, np.inf)
"""Strata of |T_m - T_h| at the start [s]."""
ALL_STARTS = "all"
MEANS = (
    *("distance_m", "distance_m_safe", "gap_m", "delay_s", "hardest_braking", "mean_jerk", "decision_flips"),
    *("first_stable_s", "human_station_rms_m", "human_speed_rms"),
)
"""Means that the summary has under the name of their column; of `distance_m_safe` and `first_stable_s` of some rows."""
SUMMED = (
    *("distance_m", "gap_m", "delay_s", "hardest_braking", "mean_jerk", "decision_flips", "human_station_rms_m"),
    *("human_speed_rms", "host_first", "merging_stopped", "unnecessary_yield", "correct_at_merge", "order_swapped"),
)
QUANTILES = {
    "hardest_braking_p95": ("hardest_braking", 0.95),
    "min_ttc_s_p05": ("min_ttc_s", 0.05),
    "max_drac_p95": ("max_drac", 0.95),
    "pet_s_p05": ("pet_s", 0.05),
    "min_leader_gap_m_p05": ("min_leader_gap_m", 0.05),
    "min_leader_ttc_s_p05": ("min_leader_ttc_s", 0.05),
    "min_follower_gap_m_p05": ("min_follower_gap_m", 0.05),
}
"""Quantiles of the summary: of which column, and which."""
COLUMNS = (
    *GROUP,
    *("case", "car", "failed", "failure_kind", "censored", "stuck", "deadlock", "in_support", "extended"),
    *("host_reached", "world", "sumo_collision", "ambiguity_s", "first_stable_s"),
    *(name for name in SUMMED if name != "unnecessary_yield"),
    *dict.fromkeys(column for column, _ in QUANTILES.values() if column != "hardest_braking"),
)
"""Columns of result rows that a summary is made of."""
_NUMBERS = tuple(
    dict.fromkeys((*SUMMED, *(set(COLUMNS) - {*GROUP, "case", "car", "failure_kind", "world"}), "own", "in_sumo"))
)
"""Numbers and flags of the rows, and those that are derived from them, which are summed up."""
D0 = 2.0
"""A host that lets the merging car pass without need kept at least this bumper gap [m] (d0 of the controller)."""


def oracle_best(rows: pa.Table) -> pa.Table:
    """Rows of the better of always-go and always-yield on each case: the one that does not fail, ties by delay.

    It is the best that constant decisions can reach. Empty where one of the two was not run, and in living traffic.
    """
    frame = rows.to_pandas()
    frame = frame[frame["method"].isin(CONSTANT) & (frame["source"] != TRAFFIC)]
    frame = frame.sort_values([*CASE, "failed", "delay_s", "method"], kind="stable")
    both = frame.groupby(CASE)["method"].transform("nunique") == len(CONSTANT)
    best = frame[both].drop_duplicates(CASE).assign(method=ORACLE_BEST)
    return pa.Table.from_pandas(best, schema=SCHEMA, preserve_index=False)


def by_start(frame: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Part rows by how ambiguous their cases begin."""
    for name, here in _start_masks(frame["ambiguity_s"].to_numpy()):
        yield name, frame[here]


def with_all_sites(frame: pd.DataFrame) -> pd.DataFrame:
    """Add each row of a scenario with several sites of one source once more, under the site `all`."""
    parts = [frame]
    for _, scenario in frame.groupby("scenario", sort=False):
        if scenario["site"].nunique() > 1 and scenario["source"].nunique() == 1:
            parts.append(scenario.assign(site=ALL_SITES))
    return pd.concat(parts)


def compare_all(rows: pd.DataFrame, against: str | None) -> dict[tuple[str, ...], dict[str, Any]]:
    """The comparison of every group (`GROUP`) with a method on the same cases."""
    return Summary(len(rows), against).add(rows).comparisons()


class Summary:
    """Summary rows of result rows that come in batches of whole cases, of any number: no more than a batch is held."""

    def __init__(self, most: int, against: str | None = None) -> None:
        """Begin.

        Args:
            most: Most rows that there will be.
            against: Method that the others are compared with on the same cases; None for none.
        """
        self._most, self._against = most, against
        self._groups: dict[str, dict[tuple[str, ...], Totals]] = {}

    def add(self, rows: pd.DataFrame) -> Self:
        """Add a batch: all rows of some cases, with the columns `COLUMNS` at least."""
        frame = rows.assign(
            unnecessary_yield=_unnecessary_yields(rows),
            own=rows["failure_kind"] != "merging_into_host",
            in_sumo=rows["world"] == "sumo",
        )
        arrays = RowArrays.of(frame, _NUMBERS)
        numbered = frame[GROUP].reset_index(drop=True).groupby(GROUP, sort=True)
        groups = {tuple(map(str, names)): group.index.to_numpy() for names, group in numbered}
        for key, places in groups.items():
            group, other = arrays.take(places), self._other_outcomes(arrays, groups, key)
            parts = () if key[SECTION.index("variation")] else _start_masks(group["ambiguity_s"])
            for start, part in [(ALL_STARTS, group), *((start, group.take(here)) for start, here in parts)]:
                if len(part):
                    totals = self._groups.setdefault(start, {}).setdefault(key, Totals(self._most))
                    _take_in(totals, part, other, is_sample_source(key[GROUP.index("source")]))
        return self

    def _other_outcomes(
        self, arrays: RowArrays, groups: Mapping[tuple[str, ...], IntArray], key: tuple[str, ...]
    ) -> IntArray | None:
        """Outcomes under the method that a group is compared with, by case; None where there is nothing to compare.

        They are those with the group's own model, if there are such.
        """
        section, method, model = key[: len(SECTION)], GROUP.index("method"), GROUP.index("model")
        if key[method] == self._against or key[SECTION.index("source")] == TRAFFIC:
            return None
        others = {
            other[model]: places
            for other, places in groups.items()
            if other[method] == self._against and other[: len(SECTION)] == section
        }
        if not others:
            return None
        places = others[key[model]] if key[model] in others else np.sort(np.concatenate([*others.values()]))
        return arrays.take(places).outcomes()

    def table(self, cycle_us: Mapping[str, tuple[float, float | None]]) -> pd.DataFrame:
        """One row per (scenario, variation, site, source, method), sorted by them.

        A scenario with several sites also gets a row over all of them where they have the same source (site `all`).

        Args:
            cycle_us: For each method the time of one update per encounter in a full batch, and in a batch of one [us].
        """
        return self._table(ALL_STARTS, cycle_us)

    def strata(self) -> pd.DataFrame:
        """The same for the cases of each ambiguity at the start, with the column `start`; variations are left out."""
        starts = [start for start in _starts() if start in self._groups]
        found = [self._table(start, {}).assign(start=start) for start in starts]
        return pd.concat(found, ignore_index=True) if found else pd.DataFrame()

    def comparisons(self) -> dict[tuple[str, ...], dict[str, Any]]:
        """See `compare_all`."""
        return {key: self._comparison(key, totals) for key, totals in self._with_all_sites(ALL_STARTS).items()}

    def _table(self, start: str, cycle_us: Mapping[str, tuple[float, float | None]]) -> pd.DataFrame:
        found = [
            _summary(dict(zip(GROUP, key, strict=True)), totals, cycle_us) | self._comparison(key, totals)
            for key, totals in self._with_all_sites(start).items()
        ]
        table = pd.DataFrame(found)
        table["p_holm"] = np.nan
        for _, section in table[table["mcnemar_p"].notna()].groupby(SECTION):
            table.loc[section.index, "p_holm"] = holm(section["mcnemar_p"].tolist())
        return table

    def _comparison(self, key: tuple[str, ...], totals: Totals) -> dict[str, Any]:
        if self._against is None or not totals.compared:
            return not_compared(self._against)
        sample = is_sample_source(key[GROUP.index("source")])
        return judged(pd.concat(totals.differing, ignore_index=True), self._against, sample)

    def _with_all_sites(self, start: str) -> dict[tuple[str, ...], Totals]:
        """All groups in order, those of all sites together where a scenario has several of one source."""
        groups = self._groups.get(start, {})
        sites: dict[str, set[tuple[str, str]]] = {}
        scenario, site, source = (GROUP.index(name) for name in ("scenario", "site", "source"))
        for key in groups:
            sites.setdefault(key[scenario], set()).add((key[site], key[source]))
        every = dict(groups)
        for key, totals in groups.items():
            there = sites[key[scenario]]
            if len({one for one, _ in there}) > 1 and len({one for _, one in there}) == 1:
                joint = (*key[:site], ALL_SITES, *key[site + 1 :])
                every.setdefault(joint, Totals(self._most)).join(totals)
        return dict(sorted(every.items()))


def is_sample(group: pd.DataFrame) -> bool:
    """A fixed grid is no sample."""
    return bool((group["source"] != "designed").all())


def is_sample_source(source: str) -> bool:
    """See `is_sample`."""
    return source != "designed"


def _start_masks(ambiguity_s: FloatArray) -> Iterator[tuple[str, BoolArray]]:
    """Names of the strata, and which cases are in each."""
    for name, (low, high) in zip(_starts(), pairwise(AMBIGUITY_EDGES), strict=True):
        yield name, (ambiguity_s >= low) & (ambiguity_s < high)


def _starts() -> list[str]:
    return [
        f"[{low:g}, {high:g}) s" if np.isfinite(high) else f">= {low:g} s" for low, high in pairwise(AMBIGUITY_EDGES)
    ]


def _take_in(totals: Totals, group: RowArrays, other: IntArray | None, sample: bool) -> None:
    """Add the rows of a group to its totals.

    Args:
        totals: The totals.
        group: The rows.
        other: Outcome of every case under the method that it is compared with, see `RowArrays.outcomes`.
        sample: The cases are a sample, so that their clusters are kept.
    """
    failed, censored = group.flag("failed"), group.flag("censored")
    labelled, supported = group.known("correct_at_merge"), group.known("in_support")
    own, in_sumo = group.flag("own"), group.flag("in_sumo")
    totals.numbers["rows"] += len(group)
    for name, rows in (
        ("n", ~censored),
        ("failures", failed & ~censored),
        ("own", own & ~censored),
        ("own_failures", own & failed & ~censored),
        ("stuck", group.flag("stuck") & ~censored),
        ("deadlocks", group.flag("deadlock") & ~censored),
        ("supported", supported),
        ("outside_support", supported & ~group.flag("in_support")),
        ("extended", group.flag("extended")),
        ("host_not_reached", ~group.flag("host_reached")),
        ("labelled", labelled),
        ("first_stable", labelled & group.known("first_stable_s")),
        ("in_sumo", in_sumo),
        ("sumo_disagrees", in_sumo & (group["sumo_collision"] != group["failed"])),
    ):
        totals.numbers[name] += int(rows.sum())
    for name in SUMMED:
        totals.sums.setdefault(name, Sum()).add(group[name])
    totals.sums.setdefault("distance_m_safe", Sum()).add(group["distance_m"][~failed])
    totals.sums.setdefault("first_stable_s", Sum()).add(group["first_stable_s"][labelled])
    for name, (column, q) in QUANTILES.items():
        values = group[column]
        totals.tails.setdefault(name, Tail(min(q, 1 - q))).add(values if q < 0.5 else -values, totals.most)
    if sample:
        logged = group.logged
        both = pd.DataFrame({"failed": np.where(censored, np.nan, 100.0 * failed), "distance": group["distance_m"]})
        totals.logged &= bool(logged.all())
        names = group.car_names[group.car] if logged.all() else group.case_names[group.case]
        totals.clusters.add(both, pd.Series(names), whole=not logged.any())
    if other is not None:
        against = other[group.case]
        common = ~censored & (against >= 0)
        totals.compared = True
        totals.differing.append(disagreement(failed[common], against[common] == 1, group.clusters()[common]))


def _summary(key: dict[str, str], totals: Totals, cycle_us: Mapping[str, tuple[float, float | None]]) -> dict[str, Any]:
    numbers, sums = totals.numbers, totals.sums
    rows, n, failures, stuck = (numbers[name] for name in ("rows", "n", "failures", "stuck"))
    censored = rows - n
    sample = is_sample_source(key["source"])
    low, high = wilson(failures, n) if sample else (None, None)
    stuck_low, stuck_high = wilson(failures + stuck, n) if sample else (None, None)
    batch_us, single_us = cycle_us.get(key["method"], (None, None))
    quantiles = {
        name: round(tail.value() if QUANTILES[name][1] < 0.5 else -tail.value(), 6) if tail.known else None
        for name, tail in totals.tails.items()
    }
    means = {name: sums[name].mean() for name in MEANS}
    return {
        **key,
        "n": n,
        "failures": failures,
        "failure_pct": percent(failures, n),
        "ci_low_pct": low,
        "ci_high_pct": high,
        **_intervals(totals, sample),
        "failure_pct_own": percent(numbers["own_failures"], numbers["own"]),
        "censored": censored,
        "failure_pct_best": percent(failures, rows),
        "failure_pct_worst": percent(failures + censored, rows),
        "stuck": stuck,
        "deadlocks": numbers["deadlocks"],
        "outside_support": numbers["outside_support"] if numbers["supported"] else None,
        "failed_or_stuck_pct": percent(failures + stuck, n),
        "failed_or_stuck_low_pct": stuck_low,
        "failed_or_stuck_high_pct": stuck_high,
        "failed_or_stuck_pct_worst": percent(failures + stuck + censored, rows),
        "extended": numbers["extended"],
        "host_not_reached": numbers["host_not_reached"],
        "host_first_pct": sums["host_first"].mean(100),
        **{name: means[name] for name in MEANS[:5]},
        "hardest_braking_p95": quantiles["hardest_braking_p95"],
        "mean_jerk": means["mean_jerk"],
        **{name: quantiles[name] for name in QUANTILES if name != "hardest_braking_p95"},
        "merging_stopped": sums["merging_stopped"].count(),
        "unnecessary_yields": sums["unnecessary_yield"].count(),
        "labelled": numbers["labelled"],
        "decision_flips": means["decision_flips"],
        "correct_at_merge_pct": sums["correct_at_merge"].mean(100),
        "first_stable_pct": percent(numbers["first_stable"], numbers["labelled"]),
        "first_stable_s": means["first_stable_s"],
        "order_swapped": sums["order_swapped"].count(),
        "human_station_rms_m": means["human_station_rms_m"],
        "human_speed_rms": means["human_speed_rms"],
        "sumo_disagrees": numbers["sumo_disagrees"] if numbers["in_sumo"] else None,
        "cycle_us": None if batch_us is None else round(batch_us, 3),
        "cycle_us_single": None if single_us is None else round(single_us, 3),
    }


def _intervals(totals: Totals, sample: bool) -> dict[str, Any]:
    """Bootstrap intervals over merging cars: of the failure rate where a car has several cases, and of D.

    Where no case failed, or all did, every resample is the same and its interval would claim certainty: there is none.
    """
    names = ("cluster_low_pct", "cluster_high_pct", "distance_low_m", "distance_high_m")
    if not sample:
        return {"cars": None, **dict.fromkeys(names)}
    clusters = totals.clusters
    cars = clusters.number
    rate, distance = clusters.intervals()
    if cars == clusters.rows or rate[0] == rate[1]:
        rate = (None, None)
    ends = (None if end is None else round(end, 4) for end in (*rate, *distance))
    return {"cars": cars if totals.logged else None, **dict(zip(names, ends, strict=True))}


def _unnecessary_yields(frame: pd.DataFrame) -> pd.Series:
    """The host passes second though always-go passes first on that case, without failure and with gap >= d0.

    Missing where always-go was not run.
    """
    go = frame[(frame["method"] == "always-go") & (frame["source"] != TRAFFIC)].drop_duplicates(CASE)
    if not len(go):
        return pd.Series(pd.NA, frame.index, dtype="boolean")
    possible = go["host_first"].eq(True) & ~go["failed"] & (go["gap_m"].fillna(np.inf) >= D0)
    known = frame[CASE].merge(go[CASE].assign(possible=possible.astype("boolean")), how="left", on=CASE)["possible"]
    known = known.set_axis(frame.index)
    passed_second = frame["host_first"].eq(False).to_numpy(dtype=bool)
    return (known & passed_second).where(known.notna())

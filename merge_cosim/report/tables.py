"""The tables of a report, as DataFrames with their headings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.report.columns import Column, Table
from merge_cosim.report.methods import in_order
from merge_cosim.report.published import published
from merge_cosim.results.statistics.summary import ALL_SITES, AMBIGUITY_EDGES, by_start
from merge_cosim.scenarios.methods import HUMAN, ORACLE_BEST

METHOD = Column("method", "method")
MODEL = Column("model", "model")
MAIN = (
    METHOD,
    MODEL,
    Column("n", "n", 0, "failures"),
    Column("failures", "count", 0, "failures", better=-1),
    Column("failure_pct", "%", 2, "failures", better=-1),
    Column("interval_pct", "95 % interval", None, "failures", range=True),
    Column("failure_pct_own", "% without rear-end hits", 2, "failures", better=-1, paper=False),
    Column("censored", "censored", 0, "failures", paper=False),
    Column("bounds_pct", "% best–worst", None, "failures", range=True, paper=False),
    Column("stuck", "stuck", 0, "failed or stuck", better=-1),
    Column("failed_or_stuck_pct", "%", 2, "failed or stuck", better=-1),
    Column("stuck_interval_pct", "95 % interval", None, "failed or stuck", range=True, paper=False),
    Column("published_failure_pct", "%", 1, "published"),
    Column("published_distance_m", "D m", 1, "published", paper=False),
    Column("host_not_reached", "never arrived", 0, "merging point", better=-1, paper=False),
    Column("distance_m", "D m", 1, "merging point"),
    Column("distance_m_safe", "D m, not failed", 1, "merging point", paper=False),
    Column("gap_m", "gap m", 1, "merging point", paper=False),
    Column("delay_s", "delay s", 2, "cost", better=-1),
    Column("hardest_braking", "brake m/s²", 2, "cost", better=-1, paper=False),
    Column("hardest_braking_p95", "brake 95 % m/s²", 2, "cost", better=-1, paper=False),
    Column("unnecessary_yields", "needless yields", 0, "cost", better=-1, paper=False),
    Column("decision_flips", "flips", 2, "decision", paper=False),
    Column("correct_at_merge_pct", "correct %", 1, "decision", better=1, paper=False),
    Column("cycle_us", "batch", 2, "cycle µs", paper=False),
    Column("cycle_us_single", "alone", 1, "cycle µs", paper=False),
)
NOT_VARIED = ("published", "decision", "cycle µs")
"""Groups of columns that the tables of varied parameters leave out."""


@dataclass(frozen=True)
class Section:
    """What one table of a report is about: a scenario at one site, from one source."""

    scenario: str
    site: str
    source: str

    def of(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The rows of this section, variations left out; site `all` takes every site."""
        chosen = (frame["scenario"] == self.scenario) & (frame["source"] == self.source) & (frame["variation"] == "")
        if self.site != ALL_SITES:
            chosen &= frame["site"] == self.site
        return frame if chosen.all() else frame[chosen]


def summary_frame(rows: list[dict[str, Any]], variations: Sequence[str] = ()) -> pd.DataFrame:
    """The summary's rows as a DataFrame, missing values NaN, with the columns that only a reader needs.

    Args:
        rows: Summary rows.
        variations: The labels `parameter=value` in the order in which the user gave them.
    """
    frame = pd.DataFrame(rows)
    figures = [published(row["scenario"], row["method"]) for row in rows]
    frame["published_failure_pct"] = [figure.failure_pct if figure else np.nan for figure in figures]
    frame["published_distance_m"] = pd.Series(
        [figure.distance_m if figure else None for figure in figures], dtype=float
    )
    frame["interval_pct"] = ranges(frame["ci_low_pct"], frame["ci_high_pct"])
    frame["stuck_interval_pct"] = ranges(frame["failed_or_stuck_low_pct"], frame["failed_or_stuck_high_pct"])
    censored = frame["censored"] > 0
    frame["bounds_pct"] = ranges(frame["failure_pct_best"].where(censored), frame["failure_pct_worst"].where(censored))
    differs = frame["failure_pct_own"].ne(frame["failure_pct"]) & frame["failure_pct"].notna()
    if not differs.any():
        frame["failure_pct_own"] = np.nan
    frame["order"] = frame["method"].map({method: i for i, method in enumerate(in_order(frame["method"]))})
    frame["place"] = frame["variation"].map({label: i for i, label in enumerate(["", *variations])})
    return frame.sort_values(["scenario", "place", "source", "site", "order"], kind="stable", ignore_index=True)


def sections(summary: pd.DataFrame) -> list[Section]:
    """All sections of a report, one per scenario, source and site; the row over all sites last."""
    rows = summary[summary["variation"] == ""][["scenario", "site", "source"]].drop_duplicates()
    found = [Section(*row) for row in rows.itertuples(index=False, name=None)]
    return sorted(found, key=lambda one: (one.scenario, one.source, one.site == ALL_SITES, one.site))


def main_table(summary: pd.DataFrame, section: Section) -> Table:
    """Every measure per method, ours beside the published figures."""
    rows = with_models(of_section(summary, section))
    return Table.of(rows, MAIN, "Outcome by method")


def strata_table(results: pd.DataFrame, section: Section) -> Table:
    """Failure rates by how ambiguous the start is, and without the cases that outlast their log."""
    rows = section.of(results)[["method", "failed", "censored", "extended", "ambiguity_s"]]
    rows = rows[~rows["censored"]]
    columns, parts = [METHOD], {}
    for (low, high), (start, part) in zip(pairwise(AMBIGUITY_EDGES), by_start(rows), strict=True):
        key, name = f"{low:g}_{high:g}s", start.replace(">=", "≥")
        parts[key] = part
        columns += [Column(f"n_{key}", "n", 0, name), Column(f"failure_pct_{key}", "%", 2, name)]
    if rows["extended"].any():
        parts["logged"] = rows[~rows["extended"]]
        columns += [
            Column("n_logged", "n", 0, "within the log"),
            Column("failure_pct_logged", "%", 2, "within the log"),
        ]
    methods = in_order(rows["method"])
    data = pd.DataFrame({"method": methods})
    for key, part in parts.items():
        failed = part.groupby("method")["failed"]
        data[f"n_{key}"] = failed.size().reindex(methods).fillna(0).astype(int).to_numpy()
        data[f"failure_pct_{key}"] = (100 * failed.mean().reindex(methods)).to_numpy()
    title = "Failures by ambiguity at the start, |T_m − T_h|"
    return Table.of(data, columns, title)


def variation_table(summary: pd.DataFrame, scenario: str, parameter: str) -> Table:
    """All values of a varied parameter, with the unvaried runs first."""
    rows = summary[(summary["scenario"] == scenario)].copy()
    rows[["parameter", "value"]] = rows["variation"].str.partition("=")[[0, 2]]
    varied = rows[rows["parameter"] == parameter]
    base = rows[(rows["variation"] == "") & rows["method"].isin(varied["method"])].assign(value="as it stands")
    rows = pd.concat([base, varied])
    rows = rows.sort_values(["source", "site", "order", "place"], kind="stable")
    columns = [METHOD, Column("value", parameter), *(column for column in MAIN[2:] if column.group not in NOT_VARIED)]
    many = [name for name in ("site", "source") if rows[name].nunique() > 1]
    columns[1:1] = [Column(name, name) for name in many]
    return Table.of(rows, columns, f"{scenario}: {parameter} varied")


def varied_parameters(summary: pd.DataFrame) -> list[tuple[str, str]]:
    """Scenario and name of each varied parameter."""
    rows = zip(summary["scenario"], summary["variation"], strict=True)
    return list(dict.fromkeys((scenario, variation.partition("=")[0]) for scenario, variation in rows if variation))


def simulated(results: pd.DataFrame) -> pd.DataFrame:
    """The rows that were simulated, without those picked from others or made from the log."""
    return results[~results["method"].isin((ORACLE_BEST, HUMAN))]


def runs_in_sumo(results: pd.DataFrame) -> pd.DataFrame:
    """Those of them that SUMO simulated."""
    return simulated(results[results["world"] == "sumo"])


def of_section(summary: pd.DataFrame, section: Section) -> pd.DataFrame:
    """The summary rows of a section, variations left out."""
    rows = summary[summary["variation"] == ""]
    same = (rows["scenario"] == section.scenario) & (rows["site"] == section.site) & (rows["source"] == section.source)
    return rows[same]


def with_models(rows: pd.DataFrame) -> pd.DataFrame:
    """Summary rows whose models are named only where a method has several of them."""
    several = rows["method"].duplicated().any()
    return rows.assign(model=rows["model"].replace("", None) if several else None)


def ranges(low: pd.Series, high: pd.Series) -> list[str | None]:
    """Write intervals; None where an end is missing."""
    pairs = zip(low.tolist(), high.tolist(), strict=True)
    return [None if pd.isna(a) or pd.isna(b) else f"{a:.1f}–{b:.1f}" for a, b in pairs]

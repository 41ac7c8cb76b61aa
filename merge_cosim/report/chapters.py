"""The chapters of a report: one for each scenario, site and source of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from merge_cosim.report import measure_tables, page_data, tables
from merge_cosim.report.columns import Table
from merge_cosim.report.methods import in_order
from merge_cosim.report.published import PUBLISHED
from merge_cosim.report.tables import Section
from merge_cosim.results.statistics.summary import ALL_SITES
from merge_cosim.results.statistics.verdict import Verdict

SOURCES = {
    "ngsim": "real NGSIM data",
    "recorded": "real recorded data",
    "surrogate": "SYNTHETIC surrogate data, made by SUMO, not real",
    "designed": "designed initial states, no data",
    "random": "random initial states, no data",
    "traffic": "SUMO's own traffic, no data",
}
"""What each source is called in headings."""
NO_SITES = ("designed", "random", "traffic")
"""Sources whose cases are not from a site's data."""
MAPPED = ("grid", "random", "drawn")
"""Kinds of encounters whose initial speeds fill a plane, so that there is a failure map."""


@dataclass(frozen=True)
class Chapter:
    """One section of the page.

    Attributes:
        key: Its id in the page.
        section: What it is about.
        title, source, about: Its heading, the source in words, and the scenario's own description.
        verdict: Which method is best, and how certain that is.
        rows: The numbers of the chart and of the short table, one entry per method.
        notes: What a reader must know beside them.
        tables: All tables by name.
        data: What the scripts draw.
    """

    key: str
    section: Section
    title: str
    source: str
    about: str
    verdict: Verdict
    rows: list[dict[str, Any]]
    notes: list[str]
    tables: dict[str, Table]
    data: dict[str, Any]

    @property
    def has_interval(self) -> bool:
        """The cases are a sample, so that rates have intervals."""
        return any(row["failed_low"] is not None for row in self.rows if row["models"] == 1)

    @property
    def has_models(self) -> bool:
        """At least one method was run with several models."""
        return any(row["models"] > 1 for row in self.rows)

    @property
    def has_stuck(self) -> bool:
        """At least one host never arrived."""
        return any(row["stuck"] for row in self.rows)


def chapter(
    number: int,
    section: Section,
    results: pd.DataFrame,
    summary: pd.DataFrame,
    manifest: dict[str, Any],
    verdict: Verdict,
    recorded: Sequence[dict[str, Any]],
) -> Chapter:
    """Make the chapter of a section."""
    rows = section.of(results)
    scenario = manifest["scenarios"][section.scenario]
    kind = scenario["encounters"]["kind"]
    found = {
        "outcome": tables.main_table(summary, section),
        "ambiguity": tables.strata_table(results, section),
        "safety": measure_tables.safety_table(summary, section),
    }
    beliefs = measure_tables.belief_table(results, section)
    if beliefs is not None:
        found["belief"] = beliefs
    own = set(rows.loc[rows["case"].isin([one["case"] for one in recorded]), "case"])
    title = _title(scenario["title"], section.site, section.source)
    outcome = page_data.outcome_rows(tables.of_section(summary, section), rows, verdict)
    data = {
        "rows": outcome,
        "map": page_data.map_data(rows) if kind in MAPPED else None,
        "delays": page_data.delay_data(rows) if kind != "grid" else None,
        "beliefs": page_data.belief_data(rows, section.site) if beliefs is not None else None,
        "cases": [i for i, one in enumerate(recorded) if one["scenario"] == section.scenario and one["case"] in own],
    }
    return Chapter(
        key=f"t{number}",
        section=section,
        title=title,
        source=SOURCES.get(section.source, section.source),
        about=" ".join(scenario["about"].split()),
        verdict=verdict,
        rows=outcome,
        notes=_notes(section, rows, scenario, manifest),
        tables={name: replace(table, subject=title) for name, table in found.items()},
        data=data,
    )


def _title(title: str, site: str, source: str) -> str:
    """The scenario's title, with the site where it does not name it."""
    if source in NO_SITES or site in title.lower().replace("-", ""):
        return title
    return f"{title}, {'all sites' if site == ALL_SITES else site}"


def _notes(section: Section, rows: pd.DataFrame, scenario: dict[str, Any], manifest: dict[str, Any]) -> list[str]:
    notes = []
    models: dict[str, list[str]] = {}
    for model, methods in rows[rows["model"] != ""].groupby("model")["method"].unique().items():
        models.setdefault(", ".join(in_order(methods)), []).append(str(model))
    notes += [f"Model{'s' * (len(names) > 1)} {', '.join(names)}: {methods}." for methods, names in models.items()]
    if section.source == "surrogate":
        notes.append("Every pair is made by SUMO, also where the text above speaks of a log: no real car is in it.")
    if section.source not in NO_SITES and scenario["merging"]["model"] != "replay":
        notes.append(
            f"Only the initial states come from {SOURCES.get(section.source, section.source)}; the merging car drives "
            f"by the model '{scenario['merging']['model']}'."
        )
    if scenario.get("host") == "ramp":
        notes.append("The host drives on the ramp; what is said of the merging car is of the car on the main road.")
    left_out = manifest.get("left_out", {}).get(section.scenario, [])
    if left_out:
        notes.append(f"{len(left_out)} cases of the scenario do not fit on the ramp and were left out.")
    if rows["smoothed_source"].any():
        smoothed = rows.drop_duplicates("case")["smoothed_source"].sum()
        notes.append(
            f"{smoothed} of the {rows['case'].nunique()} cases come from tracks that were smoothed at the source."
        )
    absent = {k: v for k, v in PUBLISHED.get(section.scenario, {}).items() if k not in set(rows["method"])}
    if absent:
        figures = ", ".join(
            f"{method} {figure.failure_pct} %" + (f" (D {figure.distance_m} m)" if figure.distance_m else "")
            for method, figure in absent.items()
        )
        notes.append(f"Published, but not run here: {figures}.")
    if section.scenario == "designed-1" and section.site != ALL_SITES:
        notes.append("The published figures are over both sites together.")
    return notes

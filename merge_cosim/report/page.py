"""The report of a sweep: one HTML file without external parts, and its tables as files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.report import case_figures, collisions, measure_tables, set_figures, tables
from merge_cosim.report.columns import Table
from merge_cosim.report.export import write_tables
from merge_cosim.report.html import Picture, render
from merge_cosim.report.methods import Look, in_order, looks
from merge_cosim.report.published import FG_GMM_PAPER, PGM_PAPER, PUBLISHED
from merge_cosim.report.tables import Section
from merge_cosim.report.traffic_table import traffic_table
from merge_cosim.results.statistics.comparison import reference_of
from merge_cosim.results.statistics.summary import ALL_SITES, GROUP, compare_all
from merge_cosim.results.store import MANIFEST, NOTES_CSV, SUMMARY_JSON, ResultFolder
from merge_cosim.simulation.worlds.traffic import TRAFFIC

REPORT = "report.html"
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
    """What the page says about one section."""

    section: Section
    title: str
    source: str
    about: str
    notes: list[str]
    tables: dict[str, Table]
    pictures: list[Picture]


def write_report(folder: Path, against: str | None = None) -> Path:
    """Write `report.html` and `tables/` into a result folder; returns the page.

    Args:
        folder: The result folder.
        against: Method to compare the others with; None for the one that the sweep chose.

    Raises:
        UserError: The folder holds no finished sweep, or not the method to compare with.
    """
    store = ResultFolder(folder)
    results = store.results().to_pandas()
    if not len(results):
        raise UserError(f"{folder}: nothing to report: no car merged next to a host; see its {NOTES_CSV}")
    manifest = store.read_json(MANIFEST)
    labels = [f"{name}={value}" for name, values in manifest["variations"] for value in values]
    summary = tables.summary_frame(_compared(store.read_json(SUMMARY_JSON), results, against), labels)
    traces = store.traces().to_pandas()
    drawn = looks(results["method"])
    chapters = [_chapter(one, results, summary, traces, manifest, drawn) for one in tables.sections(summary)]
    varied = {f"{scenario}-{name}": (scenario, name) for scenario, name in tables.varied_parameters(summary)}
    variations = {key: _variation(summary, *pair, drawn) for key, pair in varied.items()}
    contacts = collisions.collision_table(results) if len(tables.runs_in_sumo(results)) else None
    traffic = traffic_table(store.traffic())
    exported = {
        f"{c.section.scenario}-{c.section.site}-{c.section.source}-{name}": table
        for c in chapters
        for name, table in c.tables.items()
    }
    exported |= {f"vary-{key}": table for key, (table, _) in variations.items()}
    exported |= {"traffic": traffic} if traffic else {}
    write_tables(folder, exported | ({"collisions": contacts} if contacts else {}))
    file = folder / REPORT
    page = render(
        "report.html",
        head=_head(manifest, results),
        chapters=chapters,
        variations=variations.values(),
        contacts=contacts,
        traffic=traffic,
        note_lines=store.note_lines(),
        explained=collisions.explained(results),
        papers=(PGM_PAPER, FG_GMM_PAPER),
    )
    file.write_text(page, encoding="utf-8")
    return file


def _compared(rows: list[dict[str, Any]], results: pd.DataFrame, against: str | None) -> list[dict[str, Any]]:
    """Summary rows with the comparison that the reader asks for in place of the sweep's."""
    if against is None:
        return rows
    found = compare_all(results, reference_of(sorted(set(results["method"])), against))
    return [row | found[tuple(row[name] for name in GROUP)] for row in rows]


def _chapter(
    section: Section,
    results: pd.DataFrame,
    summary: pd.DataFrame,
    traces: pd.DataFrame,
    manifest: dict[str, Any],
    drawn: Mapping[str, Look],
) -> Chapter:
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
    pictures = [] if section.site == ALL_SITES else _case_pictures(section, rows, traces, drawn)
    if kind in MAPPED:
        caption = (
            "Failure map: share of the cases that failed, by both initial speeds. A dot marks speeds at which "
            "a host did not arrive in time in at least one of them."
        )
        pictures.append(Picture.of(set_figures.failure_map(rows), caption, wide=True))
    if kind != "grid":
        caption = (
            "Delay of every case against |T_m − T_h| at the start; red crosses failed. Vertical lines part the "
            "strata of the table; triangles at the edges lie beyond them."
        )
        pictures.append(Picture.of(set_figures.ambiguity_figure(rows, drawn), caption, wide=True))
    site = "all sites" if section.site == ALL_SITES else section.site
    return Chapter(
        section=section,
        title=scenario["title"] if section.source in NO_SITES else f"{scenario['title']}, {site}",
        source=SOURCES.get(section.source, section.source),
        about=f"Scenario {section.scenario}. {' '.join(scenario['about'].split())}",
        notes=_notes(section, rows, scenario, manifest),
        tables=found,
        pictures=pictures,
    )


def _notes(section: Section, rows: pd.DataFrame, scenario: dict[str, Any], manifest: dict[str, Any]) -> list[str]:
    notes = []
    models = rows[rows["model"] != ""].groupby("model")["method"].unique()
    notes += [f"Model {model}: {', '.join(in_order(methods))}." for model, methods in models.items()]
    if section.source == "surrogate":
        notes.append("Every pair is made by SUMO, also where the text above speaks of a log: no real car is in it.")
    if section.source not in NO_SITES and scenario["merging"]["model"] != "replay":
        notes.append(
            f"Only the initial states come from {SOURCES.get(section.source, section.source)}; the merging car drives "
            f"by the model '{scenario['merging']['model']}'."
        )
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


def _case_pictures(
    section: Section, rows: pd.DataFrame, traces: pd.DataFrame, drawn: Mapping[str, Look]
) -> list[Picture]:
    pictures = []
    mine = traces[(traces["scenario"] == section.scenario) & traces["case"].isin(rows["case"])]
    for case, trace in mine.groupby("case"):
        of_case = rows[rows["case"] == case]
        outcome = dict(zip(of_case["method"], of_case["failed"].astype(bool), strict=True))
        stations, speeds = case_figures.path_figures(trace, outcome, drawn)
        lead = f"Case {case}, on which the methods differ most"
        pictures.append(Picture.of(stations, f"{lead}: fronts over time; dashed at 0 the merging point, × a failure."))
        pictures.append(Picture.of(speeds, f"{lead}: speeds over time."))
        odds = case_figures.log_odds_figure(trace, drawn)
        if odds:
            limit = f"{case_figures.MOST_LOG_ODDS:g}"
            pictures.append(
                Picture.of(odds, f"{lead}: log-odds until a car arrives, drawn within ±{limit}; plain rules left out.")
            )
    return pictures


def _variation(
    summary: pd.DataFrame, scenario: str, parameter: str, drawn: Mapping[str, Look]
) -> tuple[Table, Picture]:
    table = tables.variation_table(summary, scenario, parameter)
    figure = set_figures.variation_figure(summary[summary["scenario"] == scenario], parameter, drawn)
    caption = f"{scenario}: failures by {parameter}. Dotted: the scenario as it stands. Shaded or barred: Wilson 95 %."
    return table, Picture.of(figure, caption)


def _head(manifest: dict[str, Any], results: pd.DataFrame) -> dict[str, str]:
    simulated = tables.simulated(results)
    moved = {"sumo": "in SUMO", "closed-form": "in the closed form, without SUMO"}
    counted = results.groupby(["scenario", "source", "site"])["case"].nunique().reset_index()
    cases = [
        f"{n:,} {name} ({source if source == site else f'{source}, {site}'})"
        for name, source, site, n in counted.itertuples(index=False, name=None)
    ]
    sources = sorted(set(results["source"]))
    settings = ", ".join(f"{name}={value}" for name, value in manifest["settings"].items())
    varied = "; ".join(f"{name} = {', '.join(values)}" for name, values in manifest["variations"])
    return {
        "Cases": "; ".join(cases),
        "Sources": "; ".join(f"{source}: {SOURCES.get(source, source)}" for source in sources),
        "Runs": f"{len(simulated):,} {moved[manifest['world']]}, under {simulated['method'].nunique()} methods",
        "Methods": ", ".join(in_order(results["method"])),
        "Models": ", ".join(f"{name} ({digest})" for name, digest in manifest["models"].items()) or "none",
        "Set": settings or "nothing: all parameters at their defaults",
        "Varied": varied or "nothing",
        "Seed": str(manifest["seed"]),
        "Versions": ", ".join(f"{name} {number}" for name, number in manifest["versions"].items()),
        "Wall time": f"{manifest['wall_s']:,.1f} s with {manifest['command']['jobs']} process(es)",
        "Speed": f"{manifest['vehicle_steps_per_s'] or 0:,} vehicle-steps per second",
        **(_of_sumo(manifest, sources) if manifest["world"] == "sumo" else {}),
    }


def _of_sumo(manifest: dict[str, Any], sources: list[str]) -> dict[str, str]:
    apart = f"at most {manifest['worst_station_difference_m']:.1e} m from the closed form"
    return {
        "Wall time of the loop": f"{manifest['ratio_to_bare_sumo']} times that of bare SUMO",
        "SUMO's stations": apart if sources != [TRAFFIC] else "the only ones: other cars have no closed form",
    }

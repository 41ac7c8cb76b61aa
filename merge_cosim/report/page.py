"""The report of a sweep: one HTML file without external parts, and its tables as files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.compute as pc

from merge_cosim.core.errors import UserError
from merge_cosim.report import collisions, page_data, tables
from merge_cosim.report.chapters import SOURCES, Chapter, chapter
from merge_cosim.report.columns import Table
from merge_cosim.report.export import write_tables
from merge_cosim.report.html import render
from merge_cosim.report.methods import in_order, looks
from merge_cosim.report.published import FG_GMM_PAPER, PGM_PAPER
from merge_cosim.report.trace_data import fitting, recorded_cases
from merge_cosim.report.traffic_table import traffic_table
from merge_cosim.results.notes import note_lines
from merge_cosim.results.statistics.belief import COLUMNS as OF_BELIEF
from merge_cosim.results.statistics.comparison import reference_of
from merge_cosim.results.statistics.summary import COLUMNS, GROUP, compare_all
from merge_cosim.results.statistics.verdict import verdicts
from merge_cosim.results.store import MANIFEST, NOTES_CSV, ResultFolder

REPORT = "report.html"
READ = [
    *("scenario", "variation", "site", "source", "case", "car", "method", "model", "world", "label"),
    *("host_speed_0", "merging_speed_0", "ambiguity_s", "delay_s", "host_reached_s", "merging_reached_s", "end_s"),
    *("failed", "failure_kind", "stuck", "censored", "extended", "smoothed_source", "host_reached", "sumo_collision"),
]
"""Columns of the rows that a report is made of. Those of `belief` are read only where a case has a label, those of the
summary only where another comparison is asked for."""
BRIEF_CASES = 3
"""Recorded cases of each chapter in a page that is shown in a notebook."""


@dataclass(frozen=True)
class Report:
    """The content of a report, from which the page and the figures are made.

    Attributes:
        manifest: How the results were made.
        results, summary: The rows of the folder, with the columns `READ`; the summary with further columns for readers.
        traces, recorded: The recorded cases that the page has room for, as rows and for the viewer.
        left_out: Number of recorded cases without room.
        chapters: One for each scenario, site and source.
        variations: A table for each varied parameter.
        contacts, traffic: The tables of collisions and of scenes; None where there is none.
    """

    manifest: dict[str, Any]
    results: pd.DataFrame
    summary: pd.DataFrame
    traces: pd.DataFrame
    recorded: list[dict[str, Any]]
    left_out: int
    chapters: list[Chapter]
    variations: dict[str, Table]
    contacts: Table | None
    traffic: Table | None

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by the names of their files."""
        found = {
            f"{c.section.scenario}-{c.section.site}-{c.section.source}-{name}": table
            for c in self.chapters
            for name, table in c.tables.items()
        }
        found |= {f"vary-{key}": table for key, table in self.variations.items()}
        others = {"traffic": self.traffic, "collisions": self.contacts}
        return found | {name: table for name, table in others.items() if table is not None}


def read_report(folder: Path, against: str | None = None) -> Report:
    """Read the content of a report from a result folder.

    Args:
        folder: The result folder.
        against: Method to compare the others with; None for the one that the sweep chose.

    Raises:
        UserError: The folder holds no finished sweep, or not the method to compare with.
    """
    store = ResultFolder(folder)
    labelled = bool(pc.any(pc.not_equal(store.results(["label"])["label"], "")).as_py())
    results = _frame(store, [*READ, *(OF_BELIEF if labelled else ())])
    if not len(results):
        raise UserError(f"{folder}: nothing to report: no car merged next to a host; see its {NOTES_CSV}")
    manifest = store.read_json(MANIFEST)
    labels = [f"{name}={value}" for name, values in manifest["variations"] for value in values]
    summary = tables.summary_frame(_compared(store, against), labels)
    shown, left_out = fitting(store.traces.recorded())
    traces = store.traces.read(shown).to_pandas()
    recorded = recorded_cases(traces, results)
    found = verdicts(summary, results)
    chapters = [
        chapter(i, one, results, summary, manifest, found[one.scenario, one.site, one.source], recorded)
        for i, one in enumerate(tables.sections(summary), 1)
    ]
    variations = {
        f"{scenario}-{name}": tables.variation_table(summary, scenario, name)
        for scenario, name in tables.varied_parameters(summary)
    }
    contacts = collisions.collision_table(results) if len(tables.runs_in_sumo(results)) else None
    traffic = traffic_table(store.traffic())
    return Report(manifest, results, summary, traces, recorded, left_out, chapters, variations, contacts, traffic)


def write_report(folder: Path, against: str | None = None) -> Path:
    """Write `report.html` and `tables/` into a result folder; returns the page; see `read_report`.

    Raises:
        UserError: The folder holds no finished sweep, or not the method to compare with.
    """
    report = read_report(folder, against)
    write_tables(folder, report.tables)
    file = folder / REPORT
    file.write_text(report_page(report, note_lines(ResultFolder(folder))), encoding="utf-8")
    return file


def report_page(report: Report, note_lines: Sequence[str] = (), brief: bool = False) -> str:
    """The page of a report.

    Args:
        report: Its content.
        note_lines: Notes on the results, such as events in living traffic.
        brief: Only the charts, with no more than `BRIEF_CASES` recorded cases of each chapter, for a notebook.
    """
    recorded = report.recorded
    tests = {one.key: one.data for one in report.chapters}
    if brief:
        kept = sorted({number for one in report.chapters for number in one.data["cases"][:BRIEF_CASES]})
        recorded = [recorded[number] for number in kept]
        tests = {
            key: data | {"delays": None, "beliefs": None, "cases": [kept.index(n) for n in data["cases"][:BRIEF_CASES]]}
            for key, data in tests.items()
        }
    varied = tables.varied_parameters(report.summary)
    data = {
        "methods": page_data.method_looks(looks(report.results["method"])),
        "tests": tests,
        "variations": [] if brief else [page_data.variation_data(report.summary, *pair) for pair in varied],
        "cases": recorded,
    }
    return render(
        "report.html",
        brief=brief,
        data=data,
        chapters=[replace(one, data=tests[one.key]) for one in report.chapters],
        recorded=recorded,
        left_out=report.left_out,
        variations=list(report.variations.values()),
        contacts=report.contacts,
        traffic=report.traffic,
        note_lines=note_lines,
        explained=collisions.explained(report.results),
        provenance=_provenance(report.manifest, report.results),
        papers=(PGM_PAPER, FG_GMM_PAPER),
    )


def _frame(store: ResultFolder, columns: Sequence[str]) -> pd.DataFrame:
    """Some columns of the rows; what pandas does not share with Arrow is freed column by column."""
    return store.results(list(dict.fromkeys(columns))).to_pandas(split_blocks=True, self_destruct=True)


def _compared(store: ResultFolder, against: str | None) -> list[dict[str, Any]]:
    """Summary rows with the comparison that the reader asks for in place of the sweep's."""
    rows = store.summary()
    if against is None:
        return rows
    results = _frame(store, COLUMNS)
    found = compare_all(results, reference_of(sorted(set(results["method"])), against))
    return [row | found[tuple(row[name] for name in GROUP)] for row in rows]


def _provenance(manifest: dict[str, Any], results: pd.DataFrame) -> dict[str, str]:
    simulated = tables.simulated(results[["method"]])
    methods, jobs = simulated["method"].nunique(), manifest["command"]["jobs"]
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
        "Runs": f"{len(simulated):,} {moved[manifest['world']]}, under {methods} method{'s' * (methods > 1)}",
        "Methods": ", ".join(in_order(results["method"])),
        "Models": ", ".join(f"{name} ({digest})" for name, digest in manifest["models"].items()) or "none",
        "Set": settings or "nothing: all parameters at their defaults",
        "Varied": varied or "nothing",
        "Seed": str(manifest["seed"]),
        "Versions": ", ".join(f"{name} {number}" for name, number in manifest["versions"].items()),
        "Wall time": f"{manifest['wall_s']:,.1f} s with {jobs} process{'es' * (jobs > 1)}",
        "Speed": f"{manifest['vehicle_steps_per_s'] or 0:,} vehicle-steps per second",
        **(_of_sumo(manifest) if manifest["world"] == "sumo" else {}),
    }


def _of_sumo(manifest: dict[str, Any]) -> dict[str, str]:
    apart = manifest["worst_station_difference_m"]  # 0 where none was compared: scenes have other cars
    return {
        "Wall time of the loop": f"{manifest['ratio_to_bare_sumo']} times that of bare SUMO",
        "SUMO's stations": f"at most {apart:.1e} m from the closed form" if apart else "the only ones",
    }

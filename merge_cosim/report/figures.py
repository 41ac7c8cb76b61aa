"""Every figure of a report as files for a paper: SVG, PDF and PNG, the data behind it as CSV, and the tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from merge_cosim.report import canvas, case_figures, outcome_figures, page_data, set_figures, tables
from merge_cosim.report.chapters import Chapter
from merge_cosim.report.export import file_stem, write_tables
from merge_cosim.report.failure_shares import failure_shares
from merge_cosim.report.methods import looks
from merge_cosim.report.page import Report, read_report

FORMATS = ("svg", "pdf", "png")
DPI = 300
"""Resolution of the PNG files [dots per inch]."""
CM = 1 / 2.54


@dataclass(frozen=True)
class Drawing:
    """A figure with the numbers it is drawn from."""

    name: str
    figure: Figure
    data: pd.DataFrame


def write_figures(
    folder: Path,
    out: Path,
    width_cm: float | None = None,
    font_size: float = 9.0,
    columns: Sequence[str] = (),
) -> list[Path]:
    """Write every figure of a result folder as `NAME.svg`, `.pdf`, `.png` and `.csv`, and the tables beside them.

    The arguments are those of `Results.figures`: width of a figure in cm, size of the type in pt.

    Returns:
        The files.

    Raises:
        UserError: The folder holds no finished sweep, or a column is unknown.
    """
    report = read_report(folder)
    found = dict(report.tables)
    if columns:
        outcomes = [name for name in found if name.endswith("-outcome")]
        found |= {name: found[name].choose(columns) for name in outcomes}
    files = write_tables(out, found)
    with canvas.made_for(canvas.Paper(None if width_cm is None else width_cm * CM, font_size)):
        for drawing in _drawings(report):
            stem = out / file_stem(drawing.name)
            for kind in FORMATS:
                file = stem.with_name(f"{stem.name}.{kind}")
                with canvas.style():
                    drawing.figure.savefig(file, dpi=DPI, metadata=UNDATED[kind])
                drawing.figure.set_layout_engine("none")  # the margins that the first format found are those of all
                files.append(file)
            data = stem.with_name(f"{stem.name}.csv")
            drawing.data.to_csv(data, index=False)
            files.append(data)
    return files


UNDATED: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}
"""So that the same results give the same bytes."""


def _drawings(report: Report) -> Iterator[Drawing]:
    drawn = looks(report.results["method"])
    for chapter in report.chapters:
        stem = f"{chapter.section.scenario}-{chapter.section.site}-{chapter.section.source}"
        rows = chapter.section.of(report.results)
        yield Drawing(
            f"{stem}-tradeoff", outcome_figures.tradeoff_figure(chapter.rows, drawn), pd.DataFrame(chapter.rows)
        )
        if chapter.data["map"]:
            yield Drawing(f"{stem}-failure-map", set_figures.failure_map(rows), _cells(rows))
        if chapter.data["delays"]:
            names = ["method", "case", "ambiguity_s", "delay_s", "failed"]
            yield Drawing(f"{stem}-delay", set_figures.ambiguity_figure(rows, drawn), rows[names])
        if chapter.data["beliefs"]:
            yield from _beliefs(stem, chapter, drawn)
    for scenario, parameter in tables.varied_parameters(report.summary):
        own = report.summary[report.summary["scenario"] == scenario]
        plots = page_data.variation_data(report.summary, scenario, parameter)
        data = [
            pd.DataFrame(series).rename(columns={"name": "method"}).assign(source=plot["source"], site=plot["site"])
            for plot in plots
            for series in plot["series"]
        ]
        figure = set_figures.variation_figure(own, parameter, drawn)
        yield Drawing(f"{scenario}-vary-{parameter}", figure, pd.concat(data))
    yield from _cases(report, drawn)


def _beliefs(stem: str, chapter: Chapter, drawn: Any) -> Iterator[Drawing]:
    beliefs = chapter.data["beliefs"]
    for name, key, labels in (
        ("right", "right", ("distance of the merging car [m]", "right decisions [%]")),
        ("calibration", "calibration", ("belief that it does not yield [%]", "share that did not yield [%]")),
    ):
        if beliefs[key]:
            figure = outcome_figures.lines_figure(beliefs[key], drawn, labels, diagonal=name == "calibration")
            data = pd.concat(pd.DataFrame(one).rename(columns={"name": "method"}) for one in beliefs[key])
            yield Drawing(f"{stem}-{name}", figure, data)


def _cases(report: Report, drawn: Any) -> Iterator[Drawing]:
    plain = report.results[report.results["variation"] == ""]
    first = {one["scenario"]: one for one in reversed(report.recorded)}
    for one in first.values():
        trace = report.traces[(report.traces["scenario"] == one["scenario"]) & (report.traces["case"] == one["case"])]
        rows = plain[(plain["scenario"] == one["scenario"]) & (plain["case"] == one["case"])]
        failed = dict(zip(rows["method"], rows["failed"].astype(bool), strict=True))
        stem = f"{one['scenario']}-case-{one['case'].replace('/', '-')}"
        stations, speeds = case_figures.path_figures(trace, failed, drawn)
        yield Drawing(f"{stem}-station", stations, trace)
        yield Drawing(f"{stem}-speed", speeds, trace)
        odds = case_figures.log_odds_figure(trace, drawn)
        if odds is not None:
            yield Drawing(f"{stem}-log-odds", odds, trace)


def _cells(rows: pd.DataFrame) -> pd.DataFrame:
    shares = failure_shares(rows)
    index = pd.MultiIndex.from_product([shares.hosts, shares.mergings], names=["host_speed", "merging_speed"])
    cells = [
        pd.DataFrame(
            {"method": method, "n": n.ravel(), "failed": shares.failed[method].ravel()}
            | {"never_arrived": shares.absent[method].ravel()},
            index=index,
        ).reset_index()
        for method, n in shares.n.items()
    ]
    found = pd.concat(cells, ignore_index=True)
    return found[found["n"] > 0]

"""The table of a sweep that fits a terminal: what is the same in all rows goes into its title."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.compute as pc

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.report.columns import MISSING, Column, Table
from merge_cosim.report.comparison import MEASURES, SIDES
from merge_cosim.report.traffic_table import traffic_table
from merge_cosim.results.files import readable
from merge_cosim.results.statistics.summary import SECTION, is_sample
from merge_cosim.results.statistics.verdict import verdicts
from merge_cosim.results.store import MANIFEST, RESULTS, ResultFolder
from merge_cosim.scenarios.methods import is_reference

COLUMNS = (
    Column("variation", "variation"),
    Column("method", "method"),
    Column("model", "model"),
    Column("n", "n", 0),
    Column("failures", "failed", 0),
    Column("failure_pct", "%", 2),
    Column("interval", "95 % CI", range=True),
    Column("stuck", "stuck", 0),
    Column("delay_s", "delay s", 2),
    Column("distance_m", "D m", 1),
)
WIDE = (
    *COLUMNS[:8],
    Column("failed_or_stuck_pct", "failed or stuck %", 2),
    Column("censored", "censored", 0),
    *COLUMNS[8:],
    Column("hardest_braking", "brake m/s²", 2),
    Column("unnecessary_yields", "needless yields", 0),
    Column("correct_at_merge_pct", "correct %", 1),
    Column("only_this_fails", "only this fails", 0),
    Column("only_other_fails", "only other fails", 0),
    Column("mcnemar_p", "McNemar p", 3, probability=True),
    Column("cycle_us", "cycle µs", 2),
)
"""What `--wide` shows; the failures that only one has are against the sweep's `--against`."""
TRAFFIC = (
    *("variation", "method", "scenes", "throughput_veh_h", "mean_speed", "time_loss_s", "meetings", "host_contacts"),
    *("emergency_brakings", "blocked"),
)
"""What is shown of the traffic as a whole; `--wide` shows all that there is."""
IN_TITLE = {"n": "cases each: {}", "scenes": "scenes each: {}", "stuck": "stuck: {}", "variation": "{}"}
"""How the title names what is the same in all rows."""
LESS_IS_BETTER = ("failure_pct", "stuck", "failed_or_stuck_pct", "delay_s")
COMPARED = (
    *("variation", "method", "n", "failure_pct_a", "failure_pct_b", "only_a", "only_b", "p"),
    *("distance_m_difference", "delay_s_difference"),
)
"""What is shown where many methods of two folders are compared."""
LINES = {"failure_pct": "failed %"} | MEASURES
"""The lines of a comparison of two methods."""
ROWS = [
    *("scenario", "variation", "site", "source", "case", "car", "method", "model", "failed", "stuck", "censored"),
]
"""Columns of the rows that a verdict needs."""
NAMES = ("scenario", "site", "source")


@dataclass(frozen=True)
class ShortTable:
    """A table of one scenario, site and source.

    Attributes:
        title: What it is about, and what is the same in all rows.
        columns: What is shown.
        cells: The text of every cell, methods before references.
        methods: Number of rows before the references.
        best: Row and column of the best values.
        verdict: The verdict in one or two sentences; where parameters were varied, of the scenario as it is.
    """

    title: str
    columns: tuple[Column, ...]
    cells: list[list[str]]
    methods: int
    best: frozenset[tuple[int, int]]
    verdict: str


def short_tables(path: Path, wide: bool = False, columns: Sequence[str] = ()) -> list[ShortTable]:
    """The tables of a result folder, one for each scenario, site and source.

    Args:
        path: The result folder.
        wide: Show more columns.
        columns: Columns of `summary.csv` to show instead, beside the method.

    Raises:
        UserError: There is no finished sweep, or no such column.
    """
    folder = ResultFolder(path)
    folder.check()
    manifest = folder.read_json(MANIFEST)
    summary = pd.DataFrame(folder.summary())
    if not len(summary):
        return []
    judged = verdicts(summary, rows_of_failures(folder) if is_sample(summary) else None)
    ends = zip(summary["ci_low_pct"], summary["ci_high_pct"], strict=True)
    labels = ["", *(f"{name}={value}" for name, values in manifest["variations"] for value in values)]
    ready = summary.assign(
        interval=pd.Series([None if pd.isna(low) else f"{low:.1f}–{high:.1f}" for low, high in ends], dtype=object),
        place=summary["variation"].map(lambda label: labels.index(label)),
        reference=summary["method"].map(is_reference),
        variation=summary["variation"].replace("", None),
        model=summary["model"].where(_several_models(summary), None),
    ).sort_values(["reference", "place", "failed_or_stuck_pct", "delay_s", "method"])
    shown: tuple[Column, ...] = WIDE if wide else COLUMNS
    if columns:
        shown = (*COLUMNS[:2], *(_chosen(name, summary) for name in columns if name not in ("variation", "method")))
    tables = []
    for scenario, site, source in dict.fromkeys(zip(*(summary[name] for name in NAMES), strict=True)):
        part = ready[(ready["scenario"] == scenario) & (ready["site"] == site) & (ready["source"] == source)]
        about = [name for name in dict.fromkeys((site, source)) if name != scenario]
        sentence = judged[scenario, site, source].sentence if (scenario, site, source) in judged else ""
        varied = bool(part["variation"].notna().any())
        about.append(f"world {manifest['world']}")
        verdict = f"Without variation: {sentence}" if varied else sentence
        tables.append(_table(scenario, about, part, shown, verdict, columns))
    return tables


def rows_of_failures(folder: ResultFolder) -> pd.DataFrame:
    """All rows of the cases in which some method failed or got stuck; on the others no two methods differ."""
    found = []
    with readable(folder.path / RESULTS):
        for scenario, variation in folder.rows.groups():
            for rows in folder.rows.batches(scenario, variation, ROWS) if not variation else ():
                bad = rows.filter(pc.or_(rows["failed"], rows["stuck"]))
                found.append(rows.filter(pc.is_in(rows["case"], pc.unique(bad["case"]))).to_pandas())
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame(columns=ROWS)


def traffic_tables(path: Path, wide: bool = False) -> list[ShortTable]:
    """The tables of living traffic as a whole, one for each scenario; none where there were no scenes."""
    whole = traffic_table(ResultFolder(path).traffic())
    if whole is None:
        return []
    data = whole.data.assign(reference=whole.apart, variation=whole.data.get("variation"))
    shown = [column for column in whole.columns if column.name != "scenario" and (wide or column.name in TRAFFIC)]
    parts = [(str(scenario), part) for scenario, part in data.groupby("scenario", sort=False)]
    return [_table(scenario, ["the traffic as a whole"], part, shown) for scenario, part in parts]


def compared_tables(table: Table) -> list[ShortTable]:
    """What `comparison.compare` found, in 80 columns.

    One table per scenario and variation, or per row where two methods were compared.
    """
    if "method" in table.data:
        shown = [
            replace(column, heading=f"{LINES[column.name[:-2]]}\n{column.name[-1].upper()}")
            if column.name in ("failure_pct_a", "failure_pct_b")
            else replace(column, heading=f"{column.group}\n{column.heading}")
            if column.name.endswith("_difference")
            else column
            for column in table.columns
            if column.name in COMPARED
        ]
        rows = table.data.assign(variation=table.data.get("variation", "")).fillna({"variation": ""})
        return [
            _table(f"{scenario} {variation}".rstrip(), [], part.assign(variation=None, reference=False), shown)
            for (scenario, variation), part in rows.groupby(["scenario", "variation"], sort=False)
        ]
    return [_beside(row, [column for column in table.columns if column.group]) for row in table.data.to_dict("records")]


def _beside(row: Mapping[Hashable, Any], columns: Sequence[Column]) -> ShortTable:
    """One comparison of two methods: a line per measure."""
    names = [str(row[name]) for name in SECTION if row.get(name)]
    sides = (Column("measure", ""), *(Column(side, heading, range=True) for side, heading, _ in SIDES))
    text = {column.name: column.text(row[column.name]) for column in columns}
    cells = [[heading, *(text.get(f"{name}_{side}", "") for side, *_ in SIDES)] for name, heading in LINES.items()]
    cells.insert(1, ["failed under this one only", text["only_a"], text["only_b"], "", ""])
    only_a, only_b = (int(row[f"only_{side}"]) for side in "ab")
    if only_a == only_b:
        verdict = "Both fail in as many cases" + (
            "; in the same ones." if not only_a else f"; {only_a:,} in each alone."
        )
    else:
        (few, less), (many, more) = sorted(((only_a, "A"), (only_b, "B")))
        cases = f"{many:,} case{'s' * (many > 1)}"
        verdict = f"{less} fails less: {cases} under {more} alone, {few or 'none'} under {less} alone."
    if text.get("p", MISSING) != MISSING:
        test = f"Exact test, a car's cases kept together: p = {text['p']}.".replace("= <", "< ")
        verdict = f"{verdict} {test}"
    used = [place for place in range(len(sides)) if any(line[place] not in ("", MISSING) for line in cells)]
    shown = [[line[place] for place in used] for line in cells]
    title = f"{', '.join(names)}: {text['n']} common cases"
    return ShortTable(title, tuple(sides[place] for place in used), shown, len(cells), frozenset(), verdict)


def _several_models(summary: pd.DataFrame) -> pd.Series:
    """Where a method was run with several models, so that its name does not say which."""
    models: pd.Series = summary.groupby([*NAMES, "variation", "method"])["model"].transform("nunique")
    return models > 1


def _chosen(name: str, summary: pd.DataFrame) -> Column:
    known = {column.name: column for column in WIDE}
    if name not in known and name not in summary:
        raise UserError(
            f"--columns {name}: no such column in summary.csv{did_you_mean(name, summary.columns.tolist())}"
        )
    number = pd.api.types.is_float_dtype(summary[name]) if name in summary else False
    return known.get(name, Column(name, name, 2 if number else None))


def _table(
    scenario: str,
    about: list[str],
    rows: pd.DataFrame,
    shown: Sequence[Column],
    verdict: str = "",
    kept: Sequence[str] = (),
) -> ShortTable:
    columns = []
    names = {str(label).partition("=")[0] for label in rows["variation"].dropna()}
    for column in shown:
        if column.name == "variation" and len(names) == 1:  # the parameter heads the column of its values
            column = replace(column, heading=min(names))
            rows = rows.assign(
                variation=rows["variation"].map(lambda label: label.partition("=")[2], na_action="ignore")
            )
        values = rows[column.name]
        if column.name in IN_TITLE and values.nunique(dropna=False) == 1:
            if values.notna().all():
                about.append(IN_TITLE[column.name].format(column.text(values.iloc[0])))
        elif values.notna().any() or column.name in kept:
            columns.append(column)
    methods = int((~rows["reference"]).sum())
    best = {
        (int(row), number)
        for number, column in enumerate(columns)
        if column.name in LESS_IS_BETTER
        for row in _smallest(rows[column.name].to_numpy(dtype=float)[:methods])
    }
    shown_rows = rows[[column.name for column in columns]].itertuples(index=False, name=None)
    cells = [[column.text(value) for column, value in zip(columns, row, strict=True)] for row in shown_rows]
    return ShortTable(f"{scenario} ({', '.join(about)})", tuple(columns), cells, methods, frozenset(best), verdict)


def _smallest(values: FloatArray) -> IntArray:
    """Where the smallest values are; nowhere if all are the same."""
    least, most = (np.nanmin(values), np.nanmax(values)) if np.isfinite(values).any() else (0.0, 0.0)
    return np.flatnonzero(values == least) if least < most else np.array([], dtype=np.int64)

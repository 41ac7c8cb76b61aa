"""What a notebook shows of results and runs: tables, and the report's interactive figures in a frame of their own."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from merge_cosim.report import page_data
from merge_cosim.report.html import render
from merge_cosim.report.methods import looks
from merge_cosim.report.short_table import ShortTable
from merge_cosim.report.trace_data import recorded_cases

HEIGHT = 640
"""Height of a frame [CSS pixels]."""


def frame(page: str, title: str) -> str:
    """A page in a frame of its own, so that neither it nor the notebook disturbs the other."""
    style = f"width:100%;height:{HEIGHT}px;border:0"
    return f'<iframe srcdoc="{html.escape(page)}" title="{html.escape(title)}" style="{style}"></iframe>'


def case_page(row: Mapping[str, Any], trace: pd.DataFrame) -> str:
    """The case viewer with one case under one method."""
    names = {name: str(row[name]) for name in ("scenario", "case", "method")}
    recorded = recorded_cases(trace.assign(**names), pd.DataFrame([dict(row) | {"variation": ""}]))
    data = {"methods": page_data.method_looks(looks([names["method"]])), "cases": recorded}
    return render("case.html", data=data, recorded=recorded)


def tables_html(tables: Sequence[ShortTable]) -> str:
    """Short tables with their titles and verdicts; the best values in bold."""
    return "".join(map(_table, tables))


def pairs_html(pairs: Sequence[tuple[str, str]]) -> str:
    """A table with a name and a text per row."""
    left = 'style="text-align:left"'
    rows = "".join(
        f"<tr><th {left}>{html.escape(name)}</th><td {left}>{html.escape(text)}</td></tr>" for name, text in pairs
    )
    return f"<table>{rows}</table>"


def _table(table: ShortTable) -> str:
    heads = "".join(f"<th>{html.escape(column.heading)}</th>" for column in table.columns)
    rows = []
    for number, cells in enumerate(table.cells):
        marked = [
            f"<b>{html.escape(cell)}</b>" if (number, place) in table.best else html.escape(cell)
            for place, cell in enumerate(cells)
        ]
        style = ' style="opacity:.65"' if number >= table.methods else ""
        rows.append(f"<tr{style}>" + "".join(f"<td>{cell}</td>" for cell in marked) + "</tr>")
    verdict = f"<p>{html.escape(table.verdict)}</p>" if table.verdict else ""
    head = f"<p><b>{html.escape(table.title)}</b></p>{verdict}"
    return f"{head}<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"

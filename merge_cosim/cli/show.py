"""Printing: tables for people, JSON for programs, one line for mistakes."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn

if TYPE_CHECKING:
    from merge_cosim.report.short_table import ShortTable
    from merge_cosim.sweeps.verify import Verification

LEAST_TEXT = 12
"""Texts of a table are folded to this many characters before a table is made wider than the terminal."""
MOST = 10_000
"""Wider than any table."""


def print_json(document: Any) -> None:
    """Print one JSON document on standard output; infinite numbers, which JSON has not, as `"inf"` and `"-inf"`."""
    print(json.dumps(_finite(document), indent=1, default=str, allow_nan=False))


def _finite(document: Any) -> Any:
    if isinstance(document, dict):
        return {key: _finite(value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [_finite(value) for value in document]
    return str(document) if isinstance(document, float) and not math.isfinite(document) else document


def die(message: str) -> NoReturn:
    """Say in one line what the user can mend, and end with status 2."""
    print(f"merge-cosim: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)


def verification(found: Verification) -> dict[str, Any]:
    """What came out of running rows again, as a document."""
    rows = found.differences.astype(object).where(found.differences.notna(), None).to_dict("records")
    return {"rows": found.rows, "beyond": found.beyond, "differences": rows, "notes": found.notes}


def show_verification(found: Verification) -> None:
    """Print what came out of running rows again."""
    if rows := verification(found)["differences"]:
        show_table([{str(name): _exact(value) for name, value in row.items()} for row in rows], "what differs")
    for line in (*found.notes, str(found)):
        print(line)


def _exact(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else value


def show_table(rows: Sequence[Mapping[str, Any]], title: str) -> None:
    """Print rows as a table; columns without any value are left out."""
    from rich.console import Console
    from rich.table import Table

    columns = [name for name in (rows[0] if rows else {}) if any(row[name] not in (None, "") for row in rows)]
    table = Table(title=title or None, title_justify="left", header_style="bold")
    for name in columns:
        table.add_column(
            name, justify="left" if any(isinstance(row[name], str) for row in rows) else "right", overflow="fold"
        )
    for row in rows:
        table.add_row(*(_text(row[name]) for name in columns))
    console = Console()
    if not console.is_terminal:
        console = Console(width=max(120, 16 * len(columns)))
    console.print(table)


def show_results(folder: Path, wide: bool = False, columns: Sequence[str] | None = None) -> None:
    """Print the tables of a result folder, each with its verdict."""
    from merge_cosim.report.short_table import short_tables, traffic_tables

    for table in (*short_tables(folder, wide, columns or ()), *traffic_tables(folder, wide)):
        show_short_table(table)


def show_short_table(table: ShortTable) -> None:
    """Print a sweep's table and its verdict: best values marked, references below a rule, numbers never broken."""
    from rich.box import HORIZONTALS
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    drawn = Table(box=HORIZONTALS)
    foldable = 0
    for place, column in enumerate(table.columns):
        heading = column.heading.replace(" ", "\n") if len(column.heading) > LEAST_TEXT else column.heading
        side: Literal["left", "right"] = "left" if column.is_text else "right"
        drawn.add_column(heading, justify=side, no_wrap=not column.is_text, overflow="fold")
        longest = max(len(row[place]) for row in table.cells)
        foldable += max(0, longest - LEAST_TEXT) if column.is_text else 0
    marked = {place for _, place in table.best}
    for number, row in enumerate(table.cells):
        if 0 < number == table.methods:
            drawn.add_section()
        marks = ["*" if (number, place) in table.best else " " * (place in marked) for place in range(len(row))]
        pairs = zip(row, marks, strict=True)
        drawn.add_row(*(Text(cell + mark, style="bold" if mark == "*" else "") for cell, mark in pairs))
    console = Console()
    needed = Console(width=MOST).measure(drawn).maximum - foldable
    console.print(Text(table.title, style="bold"))
    Console(width=max(console.width, needed)).print(drawn)
    notes = ["* best of its column"] * bool(table.best)
    notes += ["below the rule: references"] * (0 < table.methods < len(table.cells))
    console.print(Text("; ".join(notes), style="dim"), end="\n" if notes else "")
    console.print(Text(table.verdict), end="\n\n" if table.verdict else "\n")


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)

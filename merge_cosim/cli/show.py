"""Printing: tables for people, JSON for programs, one line for mistakes."""

from __future__ import annotations

import json
import math
import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from merge_cosim.report.short_table import ShortTable
    from merge_cosim.sweeps.verify import Verification


def print_json(document: Any) -> None:
    """Print one JSON document on standard output; infinite numbers, which JSON has not, as `"inf"` and `"-inf"`."""
    print(json.dumps(_finite(document), indent=1, default=str, allow_nan=False))


def answer(document: Any, text: object, as_json: bool) -> None:
    """Print a document for programs, or what people read instead."""
    if as_json:
        print_json(document)
    else:
        print(text)


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


def show_verification(found: Verification, only_beyond: bool = False) -> None:
    """Print what came out of running rows again: the columns that differ, and the values beyond the tolerance."""
    lines: list[str] = []
    if len(found.differences) and (found.beyond or not only_beyond):
        shown = []
        for row in verification(found)["differences"]:
            largest = "" if row["largest"] is None else f"{row['largest']:.1e}"
            place = ", ".join(
                str(row[name]) for name in ("method", "scenario", "variation", "case", "model") if row[name]
            )
            shown.append(
                {name: row[name] for name in ("column", "differ", "beyond")} | {"largest": largest, "in": place}
            )
            if row["beyond"]:
                stored, again = (
                    f"{value:.6g}" if isinstance(value, float) else value for value in (row["stored"], row["again"])
                )
                lines.append(f"{row['column']}: {stored} stored, {again} again, in {place}")
        show_table(shown, "what differs")
    for line in (*lines, *found.notes, str(found)):
        print(line)


def show_table(rows: Sequence[Mapping[str, Any]], title: str) -> None:
    """Print rows as a table; columns without any value are left out."""
    from rich.box import HORIZONTALS
    from rich.console import Console
    from rich.table import Table

    columns = [name for name in (rows[0] if rows else {}) if any(row[name] not in (None, "") for row in rows)]
    table = Table(title=title or None, title_justify="left", box=HORIZONTALS)
    for name in columns:
        table.add_column(
            name, justify="left" if any(isinstance(row[name], str) for row in rows) else "right", overflow="fold"
        )
    for row in rows:
        table.add_row(*(_text(row[name]) for name in columns))
    console = Console()
    if not console.is_terminal:
        console.width = max(console.width, 16 * len(columns))
    console.print(table)


def show_results(folder: Path, wide: bool = False, columns: Sequence[str] | None = None) -> None:
    """Print the tables of a result folder, each with its verdict."""
    from merge_cosim.report.short_table import short_tables, traffic_tables

    for table in (*short_tables(folder, wide, columns or ()), *traffic_tables(folder, wide)):
        show_short_table(table)


def show_short_table(table: ShortTable) -> None:
    """Print a sweep's table and its verdict on the terminal."""
    from rich.console import Console

    from merge_cosim.report.text_table import print_short_table

    print_short_table(table, Console())


def show_verdict(table: ShortTable) -> None:
    """Print the verdict of a table: on a terminal in lines that fit it, else in one."""
    from merge_cosim.report.text_table import wrapped

    print(wrapped(f"{table.title}: {table.verdict}", _line_width()))


def _line_width() -> int:
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize


def show_story(lines: Sequence[str]) -> None:
    """Print what happened in a case; a line that is too long for the terminal goes on below its own text."""
    width = _line_width()
    for line in lines:
        print("\n".join(textwrap.wrap(line, width, subsequent_indent=" " * 8, break_on_hyphens=False)))


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)

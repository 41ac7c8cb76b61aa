"""The short table of a sweep as text: on the terminal, or wherever text is shown."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from typing import Literal

from rich.box import HORIZONTALS
from rich.console import Console
from rich.table import Table
from rich.text import Text

from merge_cosim.report.methods import broken
from merge_cosim.report.short_table import ShortTable

LEAST_TEXT = 12
"""Names are parted in lines of this many characters, where they can be, before a table is wider than the terminal."""
MOST = 10_000
"""Wider than any table."""
WIDTH = 80
"""Characters in a line where there is no terminal."""


def print_short_table(table: ShortTable, console: Console) -> None:
    """Print a sweep's table and its verdict: best values marked, references below a rule, numbers never broken."""
    texts = {place for place, column in enumerate(table.columns) if column.is_text}
    parted = [list(row) for row in table.cells]
    whole, width = _drawn(table, parted), console.width
    if Console(width=MOST).measure(whole).maximum > width:
        parted = [
            [broken(cell, LEAST_TEXT) if i in texts else cell for i, cell in enumerate(row)] for row in table.cells
        ]
        whole = _drawn(table, parted)
    console.print(Text(table.title, style="bold"))
    longest = [max(len(line) for row in parted for line in row[place].split("\n")) for place in texts]
    foldable = sum(max(0, length - LEAST_TEXT) for length in longest)
    console.width = max(width, Console(width=MOST).measure(whole).maximum - foldable)
    console.print(whole)
    console.width = width
    notes = ["* best of its column"] * bool(table.best)
    notes += ["below the rule: references"] * (0 < table.methods < len(table.cells))
    console.print(Text("; ".join(notes), style="dim"), end="\n" if notes else "")
    console.print(Text(wrapped(table.verdict, width)), end="\n\n" if table.verdict else "\n", soft_wrap=True)


def wrapped(text: str, width: int) -> str:
    """Text in lines of a width, a number never parted from its per cent sign."""
    return textwrap.fill(text.replace(" %", "\xa0%"), width, break_on_hyphens=False).replace("\xa0", " ")


def _drawn(table: ShortTable, cells: Sequence[Sequence[str]]) -> Table:
    drawn = Table(box=HORIZONTALS)
    for column in table.columns:
        heading = column.heading
        if max(map(len, heading.split("\n"))) > LEAST_TEXT:
            heading = heading.replace(" ", "\n")
        side: Literal["left", "right"] = "left" if column.is_text else "right"
        drawn.add_column(heading, justify=side, no_wrap=not column.is_text, overflow="fold")
    marked = {place for _, place in table.best}
    for number, row in enumerate(cells):
        if 0 < number == table.methods:
            drawn.add_section()
        marks = ["*" if (number, place) in table.best else " " * (place in marked) for place in range(len(row))]
        pairs = zip(row, marks, strict=True)
        drawn.add_row(*(Text(cell + mark, style="bold" if mark == "*" else "") for cell, mark in pairs))
    return drawn


def as_text(tables: list[ShortTable]) -> str:
    """The same as plain text."""
    file = io.StringIO()
    console = Console(file=file, width=WIDTH, color_system=None)
    for table in tables:
        print_short_table(table, console)
    return file.getvalue().rstrip()

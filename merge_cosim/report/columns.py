"""Headings and number formats of tables, the same in HTML and in LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.scenarios.methods import is_reference

MISSING = "–"


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        name: Name in the DataFrame and in the CSV file.
        heading: Short heading with its unit.
        decimals: Digits after the point; None for text.
        group: Heading above several neighbouring columns.
        prose: Sentences, set to the left and wrapped.
        range: Texts that are ranges of numbers.
        probability: A p value, never written as zero: `<0.001`.
        paper: Shown in LaTeX, too, if no columns are chosen: a page is narrower than a screen.
    """

    name: str
    heading: str
    decimals: int | None = None
    group: str = ""
    prose: bool = False
    better: int = 0
    range: bool = False
    probability: bool = False
    paper: bool = True

    @property
    def is_text(self) -> bool:
        """It holds names or sentences; ranges are numbers."""
        return self.decimals is None and not self.range

    def text(self, value: Any) -> str:
        """Write one value."""
        if value is None or pd.isna(value):
            return MISSING
        if self.decimals is None:
            return str(value)
        if self.probability and value < 10**-self.decimals:
            return f"<{10**-self.decimals:.{self.decimals}f}"
        rounded = round(float(value), self.decimals) + 0.0  # no minus before a zero
        return f"{rounded:,.{self.decimals}f}".replace("-", "−")


@dataclass(frozen=True)
class Table:
    """A table as data, with how to show it.

    Attributes:
        data: One row per method or value.
        columns: What is shown, in order; `data` holds all of them.
        apart: Rows of references, which follow after a rule.
        title: Caption.
        subject: What it is about, for a caption that stands alone.
    """

    data: pd.DataFrame
    columns: tuple[Column, ...]
    apart: tuple[bool, ...]
    title: str
    subject: str = ""

    @classmethod
    def of(cls, data: pd.DataFrame, columns: Sequence[Column], title: str) -> Table:
        """Make a table; columns without any value are left out, and rows of reference methods are apart."""
        apart = map(is_reference, data["method"]) if "method" in data else (False for _ in data.index)
        kept = tuple(column for column in columns if data[column.name].notna().any())
        return cls(data[[column.name for column in kept]].reset_index(drop=True), kept, tuple(apart), title)

    @property
    def cells(self) -> list[list[str]]:
        """All values as text."""
        values = [self.data[column.name].tolist() for column in self.columns]
        return [[c.text(v) for c, v in zip(self.columns, row, strict=True)] for row in zip(*values, strict=True)]

    @property
    def groups(self) -> list[tuple[str, int]]:
        """The upper headings and how many columns each spans."""
        spans: list[tuple[str, int]] = []
        for column in self.columns:
            if spans and spans[-1][0] == column.group:
                spans[-1] = (column.group, spans[-1][1] + 1)
            else:
                spans.append((column.group, 1))
        return spans

    def best(self) -> list[list[bool]]:
        """Which cells, row by row, hold the best value of their column; references do not compete."""
        competes = ~pd.Series(self.apart, dtype=bool)
        marks = []
        for column in self.columns:
            if not column.better:
                marks.append([False] * len(self.data))
                continue
            values = pd.to_numeric(self.data[column.name], errors="coerce").where(competes).round(column.decimals or 0)
            values *= column.better
            marks.append((values.eq(values.max()) & (values.nunique() > 1)).tolist())
        return list(map(list, zip(*marks, strict=True)))

    def choose(self, names: Sequence[str]) -> Table:
        """The table with these columns only, in this order, behind its first.

        Raises:
            UserError: There is no such column.
        """
        known = {column.name: column for column in self.columns}
        for name in names:
            if name not in known:
                raise UserError(f"--columns: no column '{name}' in {self.title!r}{did_you_mean(name, list(known))}")
        kept = [self.columns[0], *(known[name] for name in names if name != self.columns[0].name)]
        return self.with_columns(replace(column, paper=True) for column in kept)

    def with_columns(self, columns: Iterable[Column]) -> Table:
        """The table with these of its columns."""
        kept = tuple(columns)
        return replace(self, columns=kept, data=self.data[[column.name for column in kept]])

"""How columns are headed and their numbers written, in HTML and in LaTeX alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

MISSING = "–"
LATEX_SIGNS = {"−": "$-$", "–": "--", "µ": r"$\mu$", "≥": r"$\geq$", "²": "$^2$", "<": "$<$"}


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
    """

    name: str
    heading: str
    decimals: int | None = None
    group: str = ""
    prose: bool = False
    range: bool = False
    probability: bool = False

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
        apart: Rows that are references, set apart.
        title: Caption.
    """

    data: pd.DataFrame
    columns: tuple[Column, ...]
    apart: tuple[bool, ...]
    title: str

    @classmethod
    def of(cls, data: pd.DataFrame, columns: Sequence[Column], apart: Sequence[bool], title: str) -> Table:
        """Make a table; columns without any value are left out."""
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

    def latex(self) -> str:
        """The table in LaTeX with booktabs rules."""
        keys = pd.MultiIndex.from_tuples([(column.group, column.heading) for column in self.columns])
        frame = pd.DataFrame(self.cells, columns=keys).replace(MISSING, "--")
        if not any(column.group for column in self.columns):
            frame.columns = keys.get_level_values(1)
        forms = {True: "p{0.3\\textwidth}", False: "l"}
        form = "".join(forms[column.prose] if column.decimals is None else "r" for column in self.columns)
        caption = self.title.replace("_", r"\_")
        text: str = frame.to_latex(
            index=False, escape=True, column_format=form, multicolumn_format="c", caption=caption
        )
        for sign, command in LATEX_SIGNS.items():
            text = text.replace(sign, command)
        return text

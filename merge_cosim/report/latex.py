"""Tables in LaTeX with booktabs rules, as wide as the lines of an article."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from merge_cosim.report.columns import Table

SIGNS = {sign: f"\\{sign}" for sign in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "|": "$|$",
    "<": "$<$",
    "−": "$-$",
    "–": "--",
    "µ": r"$\mu$",
    "≥": r"$\geq$",
    "²": "$^2$",
    "³": "$^3$",
    ">": "$>$",
}
LINE = 345.0
"""Length of a line in LaTeX's article [pt]."""
SIGN, GAP = 4.2, 6.0
"""Mean width of a sign in `footnotesize`, and the space beside a column [pt]."""
PROSE = 0.3
"""Width of a column of sentences, as a share of the line."""
BELOW = "\n\n\\medskip\n"


def latex(table: Table, label: str = "") -> str:
    """A table in LaTeX, best values in bold.

    Columns that find no room in the line follow below, behind the first column again; a group stays together.

    Args:
        table: The table; its columns that are not for paper are left out.
        label: Name for cross-references; none, if empty.
    """
    shown = table.with_columns(column for column in table.columns if column.paper)
    title = shown.title
    caption = f"{shown.subject}: {title[0].lower()}{title[1:]}" if shown.subject else title
    lines = [
        r"\begin{table}",
        r"\centering\footnotesize\setlength{\tabcolsep}{3pt}",
        f"\\caption{{{escaped(caption)}}}",
    ]
    lines += [f"\\label{{{label}}}"] if label else []
    return "\n".join([*lines, BELOW.join(_tabulars(shown)), r"\end{table}", ""])


def _tabulars(table: Table) -> Iterator[str]:
    cells = [
        [f"\\textbf{{{escaped(text)}}}" if bold else escaped(text) for text, bold in zip(*row, strict=True)]
        for row in zip(table.cells, table.best(), strict=True)
    ]
    for places in _side_by_side(table):
        columns = [table.columns[place] for place in places]
        keys = [(escaped(column.group), escaped(column.heading)) for column in columns]
        grouped = any(column.group for column in columns)
        forms = [f"p{{{PROSE}\\linewidth}}" if c.prose else "l" if c.is_text else "r" for c in columns]
        tabular: str = pd.DataFrame(
            [[row[place] for place in places] for row in cells],
            columns=pd.MultiIndex.from_tuples(keys) if grouped else pd.Index([heading for _, heading in keys]),
        ).to_latex(index=False, escape=False, column_format="".join(forms), multicolumn_format="c")
        yield tabular.rstrip()


def _side_by_side(table: Table) -> list[list[int]]:
    """Places of the columns of each part, the first column at the head of all."""
    texts = [[column.heading, *(row[i] for row in table.cells)] for i, column in enumerate(table.columns)]
    widths = [
        GAP + (PROSE * LINE if column.prose else SIGN * max(map(len, own)))
        for column, own in zip(table.columns, texts, strict=True)
    ]
    parts, used, place = [[0]], widths[0], 0
    for group, count in table.groups:
        block = [one for one in range(place, place + count) if one]
        place += count
        wide = max(sum(widths[one] for one in block), GAP + SIGN * len(group))
        pieces = [(block, wide)] if group and widths[0] + wide <= LINE else [([one], widths[one]) for one in block]
        for piece, width in pieces:
            if used + width > LINE and len(parts[-1]) > 1:
                parts.append([0])
                used = widths[0]
            parts[-1] += piece
            used += width
    return parts


def escaped(text: str) -> str:
    """Text with LaTeX's special characters escaped."""
    return "".join(SIGNS.get(sign, sign) for sign in text)

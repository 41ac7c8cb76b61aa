"""Bring docs/results.md up to date: python tools/results_page.py REPRODUCTION fills its tables from that folder.

The page is written by hand but for its blocks `<!-- table: NAME [COLUMN,...] -->` ... `<!-- end -->`, which are filled
from `REPRODUCTION/tables/NAME.csv`, a folder that `merge-cosim reproduce` wrote.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pandas as pd
from blocks import fill_page, page_parser, table


def shown(folder: Path, short: bool, argument: str) -> str | None:
    """A table of the folder, or some of its columns, as a Markdown table; rates with two decimals.

    In short mode a table that the folder does not hold is left as it is, and so are columns left out.
    """
    name, _, columns = argument.partition(" ")
    if short and not (folder / "tables" / f"{name}.csv").exists():
        return None
    rows = pd.read_csv(folder / "tables" / f"{name}.csv").convert_dtypes()  # counts stay whole beside missing ones
    if columns:
        rows = rows[[column for column in columns.split(",") if not short or column in rows]]
    cells = [
        ["–" if pd.isna(v) else f"{v:.2f}" if isinstance(v, float) else str(v) for v in values]
        for values in rows.itertuples(index=False)
    ]
    return table([heading(str(name)) for name in rows], cells, left=1 if columns else len(rows.columns))


WORDS = {
    "us101-replay": "US-101",
    "i80-replay": "I-80",
    "host_not_reached": "never arrives",
    "failed_or_stuck_pct": "failed or stuck %",
    "failure_pct": "failed %",
    "failures": "failed",
    "interval_pct": "95 %",
    "published": "published %",
    "_": " ",
}


def heading(column: str) -> str:
    """The heading of a column of these tables."""
    for name, words in WORDS.items():
        column = column.replace(name, words)
    return column


def main(argv: Sequence[str] | None = None) -> None:
    """Rewrite the page."""
    parser = page_parser(__doc__)
    parser.add_argument("folder", type=Path, help="folder that merge-cosim reproduce wrote")
    given = parser.parse_args(argv)
    fill_page("results.md", given.docs, {"table": partial(shown, given.folder, given.short)})


if __name__ == "__main__":
    main()

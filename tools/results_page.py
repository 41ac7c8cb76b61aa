"""Bring docs/results.md up to date: python tools/results_page.py REPRODUCTION fills its tables from that folder.

The page is written by hand but for its blocks `<!-- table: NAME [COLUMN,...] -->` ... `<!-- end -->`, which are filled
from `REPRODUCTION/tables/NAME.csv`, a folder that `merge-cosim reproduce` wrote.
"""

import argparse
from functools import partial
from pathlib import Path

import pandas as pd
from blocks import filled, table

PAGE = Path(__file__).parent.parent / "docs" / "results.md"


def shown(folder: Path, argument: str) -> str:
    """A table of the folder, or some of its columns, as a Markdown table; rates with two decimals."""
    name, _, columns = argument.partition(" ")
    rows = pd.read_csv(folder / "tables" / f"{name}.csv").convert_dtypes()  # counts stay whole beside missing ones
    rows = rows[columns.split(",")] if columns else rows
    cells = [
        ["–" if pd.isna(v) else f"{v:.2f}" if isinstance(v, float) else str(v) for v in values]
        for values in rows.itertuples(index=False)
    ]
    return table([str(name).replace("_", " ") for name in rows], cells, left=len(rows.columns))


def main() -> None:
    """Rewrite the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder that merge-cosim reproduce wrote")
    folder = parser.parse_args().folder
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), {"table": partial(shown, folder)}), encoding="utf-8")


if __name__ == "__main__":
    main()

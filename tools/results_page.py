"""Bring docs/results.md up to date: python tools/results_page.py REPRODUCTION fills its tables from that folder.

The page is written by hand but for its blocks `<!-- table: NAME [COLUMN,...] -->` ... `<!-- end -->`, which are filled
from `REPRODUCTION/tables/NAME.csv`, a folder that `merge-cosim reproduce` wrote.
"""

import argparse
import re
from pathlib import Path

import pandas as pd

PAGE = Path(__file__).parent.parent / "docs" / "results.md"
BLOCK = re.compile(r"<!-- table: (?P<name>\S+)(?: (?P<columns>\S+))? -->\n.*?<!-- end -->", re.DOTALL)


def table(file: Path, columns: str | None) -> str:
    """A CSV file, or some of its columns, as a Markdown table; rates with two decimals."""
    rows = pd.read_csv(file)
    rows = rows[columns.split(",")] if columns else rows
    heads = [str(name).replace("_", " ") for name in rows]
    lines = [heads, ["---"] * len(heads)]
    for values in rows.itertuples(index=False):
        lines.append(["–" if pd.isna(v) else f"{v:.2f}" if isinstance(v, float) else str(v) for v in values])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def main() -> None:
    """Rewrite the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder that merge-cosim reproduce wrote")
    folder = parser.parse_args().folder

    def fill(block: re.Match[str]) -> str:
        head = block[0].partition("\n")[0]
        return f"{head}\n{table(folder / 'tables' / (block['name'] + '.csv'), block['columns'])}<!-- end -->"

    PAGE.write_text(BLOCK.sub(fill, PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()

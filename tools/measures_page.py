"""Bring docs/measures.md up to date: python tools/measures_page.py writes its table of the columns of a result row.

The page is written by hand but for its block `<!-- columns: results.parquet -->`, which is filled from the definitions
in `merge_cosim.results.schema`.
"""

from pathlib import Path

import pyarrow as pa
from blocks import filled, table

from merge_cosim.results.schema import COLUMNS, SCHEMA_VERSION

PAGE = Path(__file__).parent.parent / "docs" / "measures.md"
TYPES = {pa.string(): "text", pa.bool_(): "yes/no", pa.float64(): "number", pa.int32(): "count"}


def columns(argument: str) -> str:
    """The columns of one file, in their order; `argument` is its name."""
    rows = [[f"`{one.name}`", TYPES[one.type], one.unit, one.meaning, one.missing] for one in COLUMNS]
    head = ["column", "type", "unit", "definition", "missing where"]
    return f"Schema version {SCHEMA_VERSION} of `{argument}`:\n\n" + table(head, rows, left=len(head))


def updated(page: str) -> str:
    """The page with its table filled anew."""
    return filled(page, {"columns": columns})


def main() -> None:
    """Rewrite the page."""
    PAGE.write_text(updated(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()

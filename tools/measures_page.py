"""Bring docs/measures.md up to date: python tools/measures_page.py writes its table of the columns of a result row.

The page is written by hand but for its block `<!-- columns: results.parquet -->`, which is filled from the definitions
in `merge_cosim.results.schema`.
"""

from collections.abc import Sequence

import pyarrow as pa
from blocks import fill_page, page_parser, table

from merge_cosim.results.schema import COLUMNS, SCHEMA_VERSION

TYPES = {pa.string(): "text", pa.bool_(): "yes/no", pa.float64(): "number", pa.int32(): "count"}


def columns(argument: str) -> str:
    """The columns of one file, in their order; `argument` is its name."""
    rows = [[f"`{one.name}`", TYPES[one.type], one.unit, one.meaning, one.missing] for one in COLUMNS]
    head = ["column", "type", "unit", "definition", "missing where"]
    return f"Schema version {SCHEMA_VERSION} of `{argument}`:\n\n" + table(head, rows, left=len(head))


def main(argv: Sequence[str] | None = None) -> None:
    """Rewrite the page."""
    fill_page("measures.md", page_parser(__doc__).parse_args(argv).docs, {"columns": columns})


if __name__ == "__main__":
    main()

"""The tables of a report as files: CSV with plain column names, LaTeX with booktabs rules."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from merge_cosim.report.columns import Table
from merge_cosim.report.latex import latex

FOLDER = "tables"


def write_tables(folder: Path, tables: Mapping[str, Table]) -> list[Path]:
    """Write each table as `tables/NAME.csv` and `tables/NAME.tex` with the label `tab:NAME`; returns the files."""
    target = folder / FOLDER
    target.mkdir(parents=True, exist_ok=True)
    files = []
    for name, table in tables.items():
        stem = file_stem(name)
        csv, tex = target / f"{stem}.csv", target / f"{stem}.tex"
        table.data.to_csv(csv, index=False)
        tex.write_text(latex(table, f"tab:{stem}"), encoding="utf-8")
        files += [csv, tex]
    return files


def file_stem(name: str) -> str:
    """A name as that of a file."""
    return re.sub(r"[^\w.+-]+", "-", name)

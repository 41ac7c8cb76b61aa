"""Compare two result folders value by value: python tools/same_results.py A B [--part].

Rows are matched by their keys (of `results.parquet`: scenario, variation, case, method); columns are compared that
both folders have, so that folders of different schema versions can be compared. Cycle times and the manifest's times
are ignored. Two missing values are equal. Exit status: 0 the same, 1 different, 2 a folder cannot be read.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

GROUP = ("scenario", "variation", "site", "source", "method")
KEYS: dict[str, tuple[str, ...]] = {
    "results.parquet": ("scenario", "variation", "case", "method"),
    "summary.csv": GROUP,
    "strata.csv": (*GROUP, "start"),
    "belief.csv": (*GROUP, "start", "gate_m"),
    "calibration.csv": (*GROUP, "gate_m", "from"),
    "scenes.csv": ("scenario", "variation", "method", "scene"),
    "traffic.csv": ("scenario", "variation", "method"),
    "traces.parquet": ("scenario", "case", "method", "time_s"),
}
"""The tables of a result folder, and the columns that name a row of each."""
RESULTS = "results.parquet"
TIMES = {"cycle_us", "cycle_us_single"}
"""Columns that differ from run to run."""
EXAMPLES = 3


class BadInputError(Exception):
    """A folder cannot be compared."""


def read(file: Path) -> pd.DataFrame:
    """One table of a folder, of any schema version."""
    try:
        table = pq.read_table(file).to_pandas() if file.suffix == ".parquet" else pd.read_csv(file, low_memory=False)
    except FileNotFoundError:
        raise BadInputError(f"{file}: missing") from None
    except (pa.ArrowException, OSError, ValueError) as error:
        raise BadInputError(f"{file}: damaged ({' '.join(str(error).split())})") from None
    keys = KEYS[file.name]
    if not len(table.columns):
        return pd.DataFrame(columns=keys)
    absent = [key for key in keys if key not in table]
    if absent and len(table):
        raise BadInputError(f"{file}: has no column {', '.join(absent)}")
    table = table.reindex(columns=[*table.columns, *absent])
    twice = table.duplicated(list(keys))
    if twice.any():
        raise BadInputError(
            f"{file}: {int(twice.sum())} rows have the key of another, such as {_name(table, keys, twice)}"
        )
    named = {key: table[key].astype(object).where(table[key].notna(), "").astype(str) for key in keys}
    return table.assign(**named).copy()  # in one piece, or pandas warns


def differences(file: str, one: pd.DataFrame, other: pd.DataFrame, part: bool = False) -> Iterator[str]:
    """What differs between two tables, a line for each column; columns of one table alone do not count.

    Args:
        file: Which table of a folder.
        one: The first table.
        other: The second one.
        part: Rows of one table alone do not count either.
    """
    keys = KEYS[file]
    both = one.merge(other, how="outer", on=list(keys), suffixes=("", "|B"), indicator="rows in")
    for side, name in (("left_only", "A"), ("right_only", "B")):
        alone = both["rows in"] == side
        if alone.any() and not part:
            yield f"{int(alone.sum())} rows in {name} alone, such as {_name(both, keys, alone)}"
    both = both[both["rows in"] == "both"]
    for column in one.columns:
        if column in keys or column in TIMES or column not in other:
            continue
        left, right = both[column], both[f"{column}|B"]
        different = ~((left == right) | (left.isna() & right.isna())).fillna(False).astype(bool)
        if different.any():
            shown = both[different].head(EXAMPLES)
            values = zip(shown[column], shown[f"{column}|B"], shown[list(keys)].to_numpy(), strict=True)
            examples = "; ".join(f"{a} != {b} ({_words(row)})" for a, b, row in values)
            yield f"{column}: {int(different.sum())} of {len(both)} differ{_largest(left, right)}: {examples}"


def _largest(left: pd.Series, right: pd.Series) -> str:
    if not all(pd.api.types.is_numeric_dtype(side) and not pd.api.types.is_bool_dtype(side) for side in (left, right)):
        return ""
    return f", by up to {(left - right).abs().max():.3g}"


def _name(rows: pd.DataFrame, keys: tuple[str, ...], where: pd.Series) -> str:
    return _words(rows.loc[where, list(keys)].iloc[0])


def _words(values: Iterable[str]) -> str:
    return " ".join(value for value in values if value)


def compare(a: Path, b: Path, part: bool = False) -> bool:
    """Print what differs between two folders, table by table; return whether they are the same.

    Raises:
        BadInputError: A folder has no results, or a table of it cannot be read.
    """
    same = True
    for file in KEYS:
        there = [(folder / file).is_file() for folder in (a, b)]
        if part and file.endswith(".csv"):
            continue  # made from all rows
        if file != RESULTS and not all(there):
            if any(there):
                print(f"{file}: only in {'AB'[there.index(True)]}")
            continue
        one, other = read(a / file), read(b / file)
        found = list(differences(file, one, other, part))
        common = len(one[list(KEYS[file])].merge(other[list(KEYS[file])]))
        if part and file == RESULTS and not common:
            raise BadInputError(f"{a} and {b} have no rows in common")
        verdict = "DIFFERENT" if found else "the same" if common or not part else "nothing to compare"
        print(f"{file}: {len(one)} and {len(other)} rows, {common} in both; {verdict}")
        for name, mine, others in (("A", one, other), ("B", other, one)):
            alone = [column for column in mine.columns if column not in others]
            if alone:
                print(f"  columns in {name} alone: {', '.join(alone)}")
        for line in found:
            print(f"  {line}")
        same = same and not found
    return same


def main(arguments: list[str] | None = None) -> int:
    """Compare, print and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("a", type=Path, metavar="A", help="a result folder")
    parser.add_argument("b", type=Path, metavar="B", help="another one")
    part_help = "compare only the rows that both have, and no summaries, which are made from all rows"
    parser.add_argument("--part", action="store_true", help=part_help)
    chosen = parser.parse_args(arguments)
    try:
        return 0 if compare(chosen.a, chosen.b, chosen.part) else 1
    except BadInputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())

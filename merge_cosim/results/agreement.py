"""How far two sets of result rows of the same cases agree, column by column."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.core.units import BoolArray, FloatArray
from merge_cosim.results.schema import KEY

NAMES = [name for name, _ in KEY]
OTHER_WORLD = 1e-4
"""Largest difference of a measure between SUMO and the closed form, absolute, or relative where it is above 1."""
BY_WORLD = ("world", "sumo_collision")
"""Columns that differ between worlds: what moved the cars, and what only SUMO reports."""
IS_THERE = "(is there)"
"""Stands for a column: whether both have the row."""
AGAIN = "|again"


def agreement(stored: pd.DataFrame, again: pd.DataFrame, tolerance: float | None = None) -> pd.DataFrame:
    """Compare stored rows with the same cases run again.

    Texts, flags and counts must be equal, and missing values missing in both.

    Args:
        stored: The stored rows.
        again: The rows of the second run; cases in only one of the two count as differences.
        tolerance: Largest difference of a measure, absolute, or relative where it is above 1; if not given,
            `OTHER_WORLD` where another world moved the cars, else 0.

    Returns:
        A row per column in which values differ: `differ` and `beyond` (numbers of rows that differ, and beyond the
        tolerance), `largest` (difference on that scale; missing where no difference can be taken), and the row of the
        largest one (`scenario`, `variation`, `case`, `method`) with both values (`stored`, `again`).
    """
    merged = stored.merge(again, how="outer", on=NAMES, suffixes=("", AGAIN), indicator="rows in")
    merged[IS_THERE], merged[IS_THERE + AGAIN] = merged["rows in"] != "right_only", merged["rows in"] != "left_only"
    found = [_line(merged, IS_THERE, 0.0)]
    both = merged[merged["rows in"] == "both"].reset_index(drop=True)
    other_world = (both["world"] != both["world" + AGAIN]).to_numpy()
    allowed = np.where(other_world, OTHER_WORLD, 0.0) if tolerance is None else tolerance
    for column in stored.columns:
        if column in BY_WORLD:
            found.append(_line(both[~other_world], column, 0.0))
        elif column not in NAMES:
            found.append(_line(both, column, allowed))
    return pd.DataFrame([line for line in found if line["differ"]], columns=list(found[0]))


def _line(rows: pd.DataFrame, column: str, allowed: FloatArray | float) -> dict[str, Any]:
    apart = _apart(rows[column], rows[column + AGAIN])
    largest = float(apart.max(initial=0.0))
    line = {
        "column": column,
        "differ": int(np.count_nonzero(apart)),
        "beyond": int(np.count_nonzero(apart > allowed)),
        "largest": largest if np.isfinite(largest) else None,
    }
    worst = rows.iloc[int(apart.argmax())] if largest else dict.fromkeys([*NAMES, column, column + AGAIN])
    return line | {name: worst[name] for name in NAMES} | {"stored": worst[column], "again": worst[column + AGAIN]}


def _apart(one: pd.Series, other: pd.Series) -> FloatArray:
    """Difference of each value; inf where a value is no number or missing, and the other is not the same."""
    if pd.api.types.is_float_dtype(one) and pd.api.types.is_float_dtype(other):
        first, second = one.to_numpy(), other.to_numpy()
        same: BoolArray = (first == second) | (np.isnan(first) & np.isnan(second))
        with np.errstate(invalid="ignore"):  # of infinite log-odds
            difference = np.abs(first - second) / np.maximum(np.abs(first), 1.0)
        return np.where(same, 0.0, np.where(np.isnan(difference), np.inf, difference))
    first, second = (values.astype(object).where(values.notna(), None).to_numpy() for values in (one, other))
    return np.where(first == second, 0.0, np.inf)

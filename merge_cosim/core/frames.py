"""Initial states in a table of the user's own, checked column by column."""

from __future__ import annotations

import numpy as np
import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import MOST_LENGTH, MOST_SPEED, AnyArray, FloatArray

NEEDED = ("host_station", "host_speed", "merging_station", "merging_speed")
OPTIONAL = {"host_length": 5.0, "merging_length": 5.0, "merge_position": 0.0}
"""Columns that may be absent, and what then stands for them [m]."""
NOT_NEGATIVE = ("host_speed", "merging_speed")
POSITIVE = ("host_length", "merging_length")


def states_of(frame: pd.DataFrame) -> tuple[AnyArray, dict[str, FloatArray]]:
    """Names of the cases, shape (n,), and the states by column, shape (n,) each.

    Raises:
        UserError: A column is missing or unknown, or a value cannot be.
    """
    for name in NEEDED:
        if name not in frame:
            raise UserError(f"the column '{name}' is missing (needed: {', '.join(NEEDED)})")
    known = ["case", *NEEDED, *OPTIONAL]
    for name in frame.columns:
        if name not in known:
            raise UserError(f"unknown column '{name}'{did_you_mean(str(name), known)}")
    if frame.empty:
        raise UserError("no row: give one per case")
    states = {name: _numbers(frame, name) for name in (*NEEDED, *OPTIONAL) if name in frame}
    given = {name: np.full(len(frame), value) for name, value in OPTIONAL.items()} | states
    if "case" not in frame:
        width = len(str(len(frame) - 1))
        return np.array([f"c{number:0{width}d}" for number in range(len(frame))]), given
    case = frame["case"].astype(str)
    if case.duplicated().any():
        raise UserError(f"column 'case': '{case[case.duplicated()].iloc[0]}' stands there twice; names must differ")
    return case.to_numpy(dtype=str), given


def _numbers(frame: pd.DataFrame, name: str) -> FloatArray:
    values = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
    wrong = ~np.isfinite(values)
    if name in NOT_NEGATIVE:
        wrong |= (values < 0) | (values > MOST_SPEED)
    if name in POSITIVE:
        wrong |= (values <= 0) | (values > MOST_LENGTH)
    if wrong.any():
        row = int(np.argmax(wrong))
        wanted = f"a positive number, at most {MOST_LENGTH:g}" if name in POSITIVE else "a number"
        wanted += f", 0 to {MOST_SPEED:g}" if name in NOT_NEGATIVE else ""
        raise UserError(f"column '{name}', row {row}: {frame[name].tolist()[row]!r} must be {wanted}")
    return values

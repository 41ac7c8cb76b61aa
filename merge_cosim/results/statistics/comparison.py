"""Two methods on the same cases: McNemar's exact test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean

DEFAULT = "pgm"
"""The method that all are compared with, if it was run and none is chosen."""


def reference_of(methods: Sequence[str], chosen: str | None) -> str | None:
    """The method to compare with: the chosen one, else `DEFAULT` if it was run.

    Raises:
        UserError: The chosen one was not run.
    """
    if chosen is not None and chosen not in methods:
        raise UserError(f"--against {chosen}: no such method in this sweep{did_you_mean(chosen, list(methods))}")
    return chosen or (DEFAULT if DEFAULT in methods else None)


def compare(own: pd.DataFrame, other: pd.DataFrame, against: str | None, is_sample: bool) -> dict[str, Any]:
    """Compare the failures of two methods on the cases that both carry to the end.

    McNemar's exact test: of the cases on which just one fails, it is a coin's toss which one does, if both are as safe.

    Args:
        own: Rows of one method, one per case.
        other: Rows of the method `against` on the same cases.
        against: Its name; None if there is none.
        is_sample: The cases are a sample, so that there is a p value; a fixed grid has counts alone.
    """
    nothing = {"against": against, "only_this_fails": None, "only_other_fails": None, "mcnemar_p": None}
    if against is None or not len(other) or (own["method"] == against).all():
        return nothing
    pairs = own[~own["censored"]].merge(other[~other["censored"]], on="case", suffixes=("", "_other"))
    this = int((pairs["failed"] & ~pairs["failed_other"]).sum())
    that = int((~pairs["failed"] & pairs["failed_other"]).sum())
    p = mcnemar(this, that) if is_sample else None
    return {"against": against, "only_this_fails": this, "only_other_fails": that, "mcnemar_p": p}


def mcnemar(one: int, other: int) -> float:
    """Two-sided p value of McNemar's exact test from the two discordant counts; 1 without any."""
    from scipy.stats import binomtest

    return float(binomtest(one, one + other, 0.5).pvalue) if one + other else 1.0

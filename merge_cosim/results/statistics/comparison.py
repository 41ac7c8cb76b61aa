"""Two methods on the same cases: on which only one of them fails, and a paired test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import AnyArray, BoolArray
from merge_cosim.results.statistics.paired import sign_flip_p

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

    The test is McNemar's exact test where the cases are independent; the cases of one merging car are kept together
    (`sign_flip_p`).

    Args:
        own: Rows of one method, one per case.
        other: Rows of the method `against` on the same cases.
        against: Its name; None if there is none.
        is_sample: The cases are a sample, so that there is a p value; a fixed grid has only counts.
    """
    if against is None or not len(other) or (own["method"] == against).all():
        return not_compared(against)
    return judged(differing(own, other), against, is_sample)


def not_compared(against: str | None) -> dict[str, Any]:
    """What `compare` gives where there is nothing to compare with."""
    return {"against": against, "only_this_fails": None, "only_other_fails": None, "mcnemar_p": None}


def differing(own: pd.DataFrame, other: pd.DataFrame) -> pd.DataFrame:
    """Common cases carried to the end by both in which one of two methods fails: `difference` (+1, -1), `cluster`."""
    pairs = own[~own["censored"]].merge(other[~other["censored"]], on="case", suffixes=("", "_other"))
    return disagreement(pairs["failed"].to_numpy(), pairs["failed_other"].to_numpy(), clusters_of(pairs).to_numpy())


def disagreement(failed: BoolArray, other_failed: BoolArray, clusters: AnyArray) -> pd.DataFrame:
    """What `differing` gives, from outcomes of two methods and clusters of the same cases, shape (n,) each."""
    apart = failed != other_failed
    return pd.DataFrame({"difference": np.where(failed[apart], 1, -1), "cluster": clusters[apart]})


def judged(cases: pd.DataFrame, against: str, is_sample: bool) -> dict[str, Any]:
    """What `compare` gives, from the cases of `differing`."""
    difference = cases["difference"]
    return {
        "against": against,
        "only_this_fails": int((difference > 0).sum()),
        "only_other_fails": int((difference < 0).sum()),
        "mcnemar_p": sign_flip_p(difference.to_numpy(), cases["cluster"].to_numpy()) if is_sample else None,
    }


def clusters_of(rows: pd.DataFrame) -> pd.Series:
    """The cluster of each row: its merging car; where that is not logged, its case."""
    return rows["car"].where(rows["car"] != "", rows["case"])

"""Counts of failures by both initial speeds, of which failure maps are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.report.methods import in_order

MOST_SPEEDS = 40
"""With more different speeds than this a failure map has classes of speeds."""
CLASSES, CASES_EACH = (1.0, 2.0, 5.0), 5
"""Widths of these classes [m/s]: the smallest that leaves so many cases for each pair of them."""


@dataclass(frozen=True)
class Shares:
    """Counts of cases by both initial speeds.

    Attributes:
        hosts, mergings: The speeds, or the middles of their classes [m/s], ascending.
        n, failed, absent: For each method the cases of a cell, those that failed, and those whose host did not arrive
            in time, shape (hosts, mergings).
    """

    hosts: FloatArray
    mergings: FloatArray
    n: dict[str, IntArray]
    failed: dict[str, IntArray]
    absent: dict[str, IntArray]


def failure_shares(results: pd.DataFrame) -> Shares:
    """Count the failures of each method in one scenario by both initial speeds, in classes where there are many."""
    speeds = results[["host_speed_0", "merging_speed_0"]].set_axis(["host", "merging"], axis=1)
    if speeds.nunique().max() > MOST_SPEEDS:
        speeds = _classes(speeds, len(results) / results["method"].nunique())
    hosts, host = np.unique(speeds["host"].to_numpy(dtype=float), return_inverse=True)
    mergings, merging = np.unique(speeds["merging"].to_numpy(dtype=float), return_inverse=True)
    cell = host * len(mergings) + merging
    counts: tuple[dict[str, IntArray], ...] = ({}, {}, {})
    for method in in_order(results["method"]):
        own = (results["method"] == method).to_numpy()
        marks = own, own & results["failed"].to_numpy(dtype=bool), own & ~results["host_reached"].to_numpy(dtype=bool)
        for found, mark in zip(counts, marks, strict=True):
            found[method] = np.bincount(cell[mark], minlength=len(hosts) * len(mergings)).reshape(len(hosts), -1)
    return Shares(hosts, mergings, *counts)


def _classes(speeds: pd.DataFrame, cases: float) -> pd.DataFrame:
    """The middles of the classes that speeds [m/s] are in, of so many cases under each method."""
    area = float(np.prod(np.ptp(speeds.to_numpy(dtype=float), axis=0)))
    width = next((one for one in CLASSES if area / one**2 * CASES_EACH <= cases), CLASSES[-1])
    return (speeds // width + 0.5) * width

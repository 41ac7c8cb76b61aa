"""Contacts: where SUMO's report and our geometry differ, and of what kind each difference is."""

from __future__ import annotations

import numpy as np
import pandas as pd

SAME_INSTANT = 1e-6
"""Times closer than this [s] are the same instant."""
ON_THE_LINE = "on-the-line"
BEFORE_SCORING = "before-scoring"
UNEXPLAINED = "unexplained"

REASONS = {
    ON_THE_LINE: "Ours only: in that cycle a front bumper stands on the merging point to within the tolerance. It has "
    "arrived for us, but for SUMO it is still on the edge before, where the other car is not, so SUMO reports the "
    "contact one step later, when our run has ended.",
    BEFORE_SCORING: "SUMO only: the merging car changes lane beside or just ahead of a host whose front has not "
    "reached the merging point yet. We score once both have; with --set test.overlap_from=lane_change these are "
    "failures, too.",
    UNEXPLAINED: "Of no known kind: look at these cases with merge-cosim run --trace.",
}
"""One sentence for each kind of difference."""


def kinds_of_difference(results: pd.DataFrame) -> pd.Series:
    """The kind of each row in which SUMO and our geometry differ, by row index."""
    rows = results[results["failed"] != results["sumo_collision"]]
    reached = rows[["host_reached_s", "merging_reached_s"]].astype(float)
    just_now = (reached.sub(rows["end_s"], axis=0).abs() < SAME_INSTANT).any(axis=1)
    merging_first = reached["merging_reached_s"] < reached["host_reached_s"].fillna(np.inf)
    kinds = np.where(rows["failed"] & just_now, ON_THE_LINE, UNEXPLAINED)
    return pd.Series(np.where(~rows["failed"] & merging_first, BEFORE_SCORING, kinds), index=rows.index, dtype=str)

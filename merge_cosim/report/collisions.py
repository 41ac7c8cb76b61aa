"""SUMO's collision report beside our geometry: how often they agree, and the reasons where they do not."""

from __future__ import annotations

import numpy as np
import pandas as pd

from merge_cosim.report.columns import Column, Table
from merge_cosim.report.tables import runs_in_sumo
from merge_cosim.scoring.scoring import KINDS

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


def collision_table(results: pd.DataFrame) -> Table:
    """Counts of agreement per scenario and source, over all simulated runs."""
    rows = runs_in_sumo(results)
    ours, sumo = rows["failed"], rows["sumo_collision"]
    counted = rows[["scenario", "source"]].assign(
        runs=1, both=ours & sumo, ours_only=ours & ~sumo, sumo_only=~ours & sumo, neither=~ours & ~sumo
    )
    columns = [
        Column("scenario", "scenario"),
        Column("source", "source"),
        Column("runs", "runs", 0),
        Column("both", "both", 0, "contact reported by"),
        Column("ours_only", "ours only", 0, "contact reported by"),
        Column("sumo_only", "SUMO only", 0, "contact reported by"),
        Column("neither", "neither", 0, "contact reported by"),
    ]
    for kind in filter(None, KINDS):
        counted[kind] = rows["failure_kind"] == kind
        columns.append(Column(kind, kind.replace("_", " "), 0, "our failures by kind"))
    data = counted.groupby(["scenario", "source"], as_index=False).sum()
    return Table.of(data, columns, [False] * len(data), "SUMO's collision report against our geometry")


def explained(results: pd.DataFrame) -> list[tuple[int, str, str]]:
    """Count, sentence and an example for each kind of difference that occurs."""
    rows = runs_in_sumo(results)
    kinds = kinds_of_difference(rows)
    found = []
    for kind, reason in REASONS.items():
        cases = rows.loc[kinds.index[kinds == kind]]
        if len(cases):
            first = cases.iloc[0]
            found.append((len(cases), reason, f"{first['scenario']} {first['case']} under {first['method']}"))
    return found

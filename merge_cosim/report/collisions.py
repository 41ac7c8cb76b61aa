"""SUMO's collision report beside our geometry: how often they agree, and the reasons where they do not."""

from __future__ import annotations

import pandas as pd

from merge_cosim.report.columns import Column, Table
from merge_cosim.report.tables import runs_in_sumo
from merge_cosim.results.contacts import REASONS, kinds_of_difference
from merge_cosim.scoring.scoring import KINDS


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
    return Table.of(data, columns, "SUMO's collision report against our geometry")


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

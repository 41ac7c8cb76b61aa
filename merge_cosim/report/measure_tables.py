"""Tables beside the main one: surrogate safety and comparison, and the quality of the beliefs by distance."""

from __future__ import annotations

import pandas as pd

from merge_cosim.report.columns import Column, Table
from merge_cosim.report.methods import in_order
from merge_cosim.report.tables import METHOD, MODEL, Section, of_section, ranges, with_models
from merge_cosim.results.statistics import belief
from merge_cosim.results.statistics.summary import ALL_STARTS

SAFETY = (
    METHOD,
    MODEL,
    Column("cluster_pct", "failures % by car", None, "95 % intervals, bootstrap", range=True, paper=False),
    Column("distance_interval_m", "D m", None, "95 % intervals, bootstrap", range=True, paper=False),
    Column("min_ttc_s_p05", "TTC 5 % s", 2, "surrogate safety"),
    Column("max_drac_p95", "DRAC 95 % m/s²", 2, "surrogate safety", paper=False),
    Column("pet_s_p05", "PET 5 % s", 2, "surrogate safety"),
    Column("min_leader_gap_m_p05", "leader gap 5 % m", 2, "others in the lane", paper=False),
    Column("min_leader_ttc_s_p05", "leader TTC 5 % s", 2, "others in the lane", paper=False),
    Column("min_follower_gap_m_p05", "follower gap 5 % m", 2, "others in the lane", paper=False),
    Column("merging_stopped", "merging car stopped", 0, "others in the lane", paper=False),
    Column("mean_jerk", "jerk m/s³", 2, "comfort", paper=False),
    Column("human_station_rms_m", "station m", 1, "RMS from the human", paper=False),
    Column("human_speed_rms", "speed m/s", 2, "RMS from the human", paper=False),
    Column("labelled", "n", 0, "stable and right", paper=False),
    Column("first_stable_pct", "%", 1, "stable and right", paper=False),
    Column("first_stable_s", "from s", 2, "stable and right", paper=False),
)
BELIEF = (
    METHOD,
    Column("gate_m", "m away", 0),
    Column("n", "n", 0),
    Column("accuracy_pct", "right %", 1),
    Column("auc", "AUC", 3),
    Column("auc_arrival", "AUC of T_h − T_m", 3, paper=False),
    Column("brier", "Brier", 3),
    Column("log_loss", "log loss", 3),
    Column("calibration_error", "calibration error", 3, paper=False),
)


def safety_table(summary: pd.DataFrame, section: Section) -> Table:
    """Surrogate safety, comfort, difference to the logged host, and failures of pairs of methods on the same cases."""
    rows = with_models(of_section(summary, section))
    rows["cluster_pct"] = ranges(rows["cluster_low_pct"], rows["cluster_high_pct"])
    rows["labelled"] = rows["labelled"].where(rows["labelled"] > 0)
    rows["distance_interval_m"] = ranges(rows["distance_low_m"], rows["distance_high_m"])
    against = rows["against"].dropna().unique()
    group = f"against {against[0]}" if len(against) else ""
    compared = (
        Column("only_this_fails", "only this fails", 0, group),
        Column("only_other_fails", "only that fails", 0, group),
        Column("mcnemar_p", "McNemar p", 4, group, probability=True),
    )
    title = "Surrogate safety, and failures on the same cases"
    return Table.of(rows, (*SAFETY, *compared), title)


def belief_table(results: pd.DataFrame, section: Section) -> Table | None:
    """Beliefs by distance of the merging car, in closed loop; None where no case has a label."""
    found = belief(section.of(results))
    if not len(found):
        return None
    found = found[found["start"] == ALL_STARTS]
    found = found[(found["site"] == section.site) | (found["site"].nunique() == 1)]
    order = {method: i for i, method in enumerate(in_order(found["method"]))}
    found = found.assign(order=found["method"].map(order)).sort_values(["order", "gate_m"], ascending=[True, False])
    title = "Beliefs at fixed distances of the merging car"
    return Table.of(found, BELIEF, title)

"""Recorded cases as plain JSON values for the page's case viewer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.report.methods import in_order
from merge_cosim.report.page_data import number
from merge_cosim.scenarios.methods import is_reference

QUANTITIES = {
    "host_station": ("host_station_m", 2),
    "host_speed": ("host_speed_m_s", 2),
    "host_acceleration": ("host_acceleration_m_s2", 2),
    "merging_station": ("merging_station_m", 2),
    "merging_speed": ("merging_speed_m_s", 2),
    "belief": ("belief", 3),
    "follows": ("not_yield", 0),
}
"""What is drawn of each cycle: its column, and the digits that are kept after the point."""
MOST_CYCLES = 240_000
"""Cycles that a page holds; cases beyond are left to traces.parquet. Some 15 characters each, or 35 with costs."""
COSTS = {"cost_s ": "s", "cost ": ""}
"""How columns of the expected costs of a planner's policies begin, with their unit; a policy's number is its place."""
MOST_COST = 10.0
"""Costs are kept up to this much above the cheapest policy's."""


def fitting(recorded: pd.DataFrame) -> tuple[list[tuple[str, str]], int]:
    """The recorded cases that a page has room for, as scenario and case, and how many others there are.

    The first of every scenario comes first, then the second of every one, and so on.

    Args:
        recorded: Scenario, case, method and number of cycles of every record.
    """
    cases = recorded.groupby(["scenario", "case"], sort=False)["cycles"].sum().reset_index()
    cases = cases.iloc[cases.groupby("scenario").cumcount().argsort(kind="stable")]
    shown = cases[cases["cycles"].cumsum() <= MOST_CYCLES].sort_index()
    return list(zip(shown["scenario"], shown["case"], strict=True)), len(cases) - len(shown)


def recorded_cases(traces: pd.DataFrame, results: pd.DataFrame) -> list[dict[str, Any]]:
    """Recorded cases with all their methods.

    Numbers are stored as whole multiples of their last digit, each as its difference from the cycle before.
    """
    if traces.empty:
        return []
    recorded = results["case"].isin(traces["case"].unique())
    rows = results[recorded & (results["variation"] == "")].drop_duplicates(
        ["scenario", "case", "method"]
    )  # of several models the first
    rows = rows.set_index(["scenario", "case", "method"]).sort_index()
    found: list[dict[str, Any]] = []
    for (scenario, case), records in traces.groupby(["scenario", "case"], sort=False):
        runs = [_run(records[records["method"] == method], method) for method in in_order(records["method"])]
        begun = min(run["start"] for run in runs)  # in living traffic the scene's time
        for run in runs:
            run["start"] = round(run["start"] - begun, 3)
            run |= _outcome(rows, (scenario, case, run["method"]))
        first = next(iter(runs))
        found.append(
            {
                "scenario": scenario,
                "case": case,
                "host_speed": first.pop("host_speed_0", None),
                "merging_speed": first.pop("merging_speed_0", None),
                "failed": sum(run["failed"] for run in runs if not is_reference(run["method"])),
                "stuck": sum(run["outcome"] == "stuck" for run in runs if not is_reference(run["method"])),
                "rivals": sum(not is_reference(run["method"]) for run in runs),
                "runs": runs,
            }
        )
    return found


def _run(records: pd.DataFrame, method: str) -> dict[str, Any]:
    odds = records["log_odds"].to_numpy(dtype=float)
    columns = records.assign(belief=0.5 + 0.5 * np.tanh(0.5 * odds))
    series = {name: differences(columns[column], decimals) for name, (column, decimals) in QUANTITIES.items()}
    time = records["time_s"].to_numpy(dtype=float)
    step = float(time[1] - time[0]) if len(time) > 1 else 0.1
    run = {"method": method, "start": round(float(time[0]), 3), "step": round(step, 3), "series": series}
    begins = [(begin, name) for begin in COSTS for name in map(str, records) if name.startswith(begin)]
    begin = next((begin for begin, name in begins if records[name].notna().any()), None)
    if begin is None:
        return run
    costs = [name for own, name in begins if own == begin and records[name].notna().any()]
    planned = records[records[costs[0]].notna()]  # up to the cycle in which the merging car is in the lane
    most = planned[costs].min(axis=1) + MOST_COST
    return run | {
        "unit": COSTS[begin],
        "policies": [name.removeprefix(begin) for name in costs],
        "costs": [differences(planned[name].clip(upper=most), 1) for name in costs],
        "policy": differences(planned["policy"], 0),
    }


def _outcome(rows: pd.DataFrame, key: tuple[Any, ...]) -> dict[str, Any]:
    if key not in rows.index:
        return {"failed": False, "outcome": "recorded"}
    row = rows.loc[key]
    outcome = next((name for name in ("failed", "stuck", "censored") if bool(row[name])), "passed")
    kind = f" ({row['failure_kind'].replace('_', ' ').replace('side', 'side by side')})" if row["failure_kind"] else ""
    return {
        "failed": bool(row["failed"]),
        "outcome": outcome + kind,
        "delay": number(row["delay_s"], 2),
        "host_speed_0": number(row["host_speed_0"], 2),
        "merging_speed_0": number(row["merging_speed_0"], 2),
    }


def differences(values: Sequence[float] | pd.Series, decimals: int) -> list[int]:
    """Values as whole multiples of 10^-decimals, the first as it is, each other as its difference from the last one.

    A missing value repeats the one before; 0 where there is none.
    """
    known = pd.Series(values).astype(float).ffill().fillna(0.0).to_numpy()
    whole: list[int] = np.diff(np.rint(known * 10**decimals).astype(int), prepend=0).tolist()
    return whole

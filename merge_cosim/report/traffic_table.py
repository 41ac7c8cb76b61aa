"""The table of scenes: measures of the traffic as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from merge_cosim.report.columns import Column, Table
from merge_cosim.report.methods import in_order

COLUMNS = (
    Column("scenario", "scenario"),
    Column("variation", "variation"),
    Column("method", "method"),
    Column("scenes", "scenes", 0),
    Column("throughput_veh_h", "cars out per h", 0, "all cars"),
    Column("mean_speed", "speed m/s", 2, "all cars"),
    Column("time_loss_s", "time lost s", 2, "all cars"),
    Column("emergency_brakings", "emergency brakings", 0, "all cars"),
    Column("other_contacts", "contacts without a host", 0, "all cars"),
    Column("hosts", "hosts", 0, "hosts"),
    Column("meetings", "meetings", 0, "hosts"),
    Column("meetings_scored", "scored", 0, "hosts"),
    Column("merging_stopped", "merging car stopped", 0, "hosts"),
    Column("host_contacts", "contacts", 0, "hosts"),
    Column("cars", "at the start, mean", 1, "logged cars"),
    Column("released", "released", 0, "logged cars"),
    Column("blocked", "no room", 0, "logged cars"),
    Column("driven_through", "drove into a host", 0, "logged cars"),
    Column("teleports", "teleports", 0, "events"),
    Column("two_hosts", "two hosts at once", 0, "events"),
    Column("hosts_off_lane", "off the host lane", 0, "events"),
    Column("hosts_not_departed", "never departed", 0, "events"),
)


def traffic_table(rows: Sequence[dict[str, Any]]) -> Table | None:
    """One row per scenario, variation and method; None where there were no scenes."""
    if not rows:
        return None
    frame = pd.DataFrame(rows).reindex(columns=[column.name for column in COLUMNS])
    numbers = [column.name for column in COLUMNS if column.decimals is not None]
    frame[numbers] = frame[numbers].apply(pd.to_numeric)
    frame["variation"] = frame["variation"].replace("", None)
    order = {method: place for place, method in enumerate(in_order(frame["method"]))}
    frame = frame.sort_values(
        ["scenario", "variation", "method"],
        key=lambda column: column.map(order) if column.name == "method" else column.fillna(""),
        kind="stable",
    )
    return Table.of(frame, COLUMNS, "The traffic as a whole")

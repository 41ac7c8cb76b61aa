"""Statistics over scenes: measures of the traffic as a whole under each method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from merge_cosim.results.store import NOTES_CSV, SCENES_CSV, TRAFFIC_CSV

GROUP = ["scenario", "variation", "method", "model"]
MEANS = ("throughput_veh_h", "mean_speed", "time_loss_s", "cars")
"""Facts whose mean over scenes is given; all other facts are summed. A fact that a kind of scene lacks is missing."""


def scene_tables(scenes: Sequence[dict[str, Any]]) -> dict[str, pd.DataFrame]:
    """By file name: every scene's facts; one row per scenario, variation and method; and a row for every note."""
    notes = [
        {**{name: scene[name] for name in (*GROUP[:3], "scene")}, "event": event, "what": line}
        for scene in scenes
        for event, line in scene["notes"]
    ]
    facts = pd.DataFrame([{k: v for k, v in scene.items() if k != "notes"} for scene in scenes])
    if not len(facts):
        return dict.fromkeys((SCENES_CSV, TRAFFIC_CSV, NOTES_CSV), facts)
    facts = facts.astype({name: float for name in MEANS if name in facts})  # None is missing
    groups = facts.groupby(GROUP, sort=True)
    columns = [groups["scene"].count().rename("scenes")]
    for name in facts.columns.difference([*GROUP, "scene", "seed"], sort=False):
        columns.append(groups[name].mean() if name in MEANS else groups[name].sum(min_count=1))
    traffic = pd.concat(columns, axis=1)
    facts = facts.sort_values([*GROUP, "scene"], ignore_index=True)
    found = pd.DataFrame(notes).sort_values([*GROUP[:3], "scene"], kind="stable") if notes else pd.DataFrame()
    return {SCENES_CSV: facts, TRAFFIC_CSV: traffic.round(3).reset_index(), NOTES_CSV: found}

"""The ratios of one bench against those of an earlier one: what holds on another machine, too."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from merge_cosim.core.errors import UserError


def read_figures(file: Path) -> dict[str, Any]:
    """Figures that `merge-cosim bench --json` or `--page` wrote.

    Raises:
        UserError: The file is missing or holds something else.
    """
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        ratios(found)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise UserError(
            f"{file}: no figures of a bench; merge-cosim bench --page bench.md writes bench.json"
        ) from error
    return dict(found)


def ratios(found: Mapping[str, Any]) -> dict[str, float]:
    """Ratios of processor times within one run; larger is better."""
    named = {
        f"loop: faster than {name}": found[f"cpu_speedup_vs_{name}"]
        for name in ("scalar", "restart", "traci")
        if f"cpu_speedup_vs_{name}" in found
    }
    if "ratio_to_bare_sumo" in found:
        named["loop: share of time inside SUMO's steps"] = round(1 / found["ratio_to_bare_sumo"], 3)
    for row in found.get("worlds", ()):
        named[f"closed form: cheaper than SUMO, {row['method']}"] = row["closed_form_is_cheaper_by"]
    for row in found.get("peers", ()):
        if row["ours_makes_more_by"] not in (None, 1.0):
            named[f"environment: more steps than {row['simulator']}"] = row["ours_makes_more_by"]
    return named


def against(found: Mapping[str, Any], before: Mapping[str, Any], tolerance: float) -> list[dict[str, Any]]:
    """A row per ratio that both have.

    Args:
        found: Figures of this run.
        before: Figures of the earlier one.
        tolerance: A ratio that fell by more than this share is `worse`.
    """
    now, then = ratios(found), ratios(before)
    return [
        {
            "ratio": name,
            "before": then[name],
            "now": now[name],
            "change_pct": round(100 * (now[name] / then[name] - 1), 1),
            "worse": now[name] < (1 - tolerance) * then[name],
        }
        for name in now
        if name in then
    ]

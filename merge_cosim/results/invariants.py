"""Invariants of many runs: how many encounters broke which, and which was the first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from merge_cosim.results.contacts import UNEXPLAINED, kinds_of_difference
from merge_cosim.scoring.invariants import INVARIANTS
from merge_cosim.simulation.loop import Run

Checked = Mapping[str, Any]
"""`encounters`: how many were checked; `broken`: by invariant, how many broke it; `first`: the first of these, by name.
Ready for JSON."""
_NAMES = ("scenario", "variation", "method", "model", "case")
_CONTACT = (*_NAMES, "failed", "sumo_collision", "host_reached_s", "merging_reached_s", "end_s")


def checked(run: Run, rows: pa.Table) -> Checked:
    """The invariants of a run: how many encounters broke each."""
    broken = {name: np.flatnonzero(where) for name, where in run.broken.items()}
    if run.world == "sumo" and not pc.all(pc.equal(rows["failed"], rows["sumo_collision"])).as_py():
        kinds = kinds_of_difference(rows.select(_CONTACT).to_pandas())
        broken["contact"] = kinds.index[kinds == UNEXPLAINED].to_numpy()
    broken = {name: where for name, where in broken.items() if len(where)}
    return {
        "encounters": len(rows),
        "broken": {name: len(where) for name, where in broken.items()},
        "first": {
            name: min(map(_named, rows.select(_NAMES).take(where).to_pylist())) for name, where in broken.items()
        },
    }


def joined(parts: Iterable[Checked]) -> dict[str, Any]:
    """The same of several runs, with every invariant counted; their order does not matter."""
    total: dict[str, Any] = {"encounters": 0, "broken": dict.fromkeys(INVARIANTS, 0), "first": {}}
    for part in parts:
        total["encounters"] += part["encounters"]
        for name, count in part["broken"].items():
            total["broken"][name] += count
        for name, case in part["first"].items():
            total["first"][name] = min(case, total["first"].get(name, case))
    return total


def is_checked(found: object) -> bool:
    """Whether what was read from a file has the form of `Checked`, with a first case of every broken invariant."""
    match found:
        case {"encounters": int(), "broken": {**broken}, "first": {**first}}:
            counts = all(isinstance(count, int) for count in broken.values())
            return counts and {name for name, count in broken.items() if count} <= INVARIANTS.keys() & first.keys()
    return False


def lines(found: Checked) -> list[str]:
    """A line for each invariant that was broken."""
    return [
        f"broken invariant '{name}' ({INVARIANTS[name]}): {count:,} of {found['encounters']:,} encounters, such as "
        f"{found['first'][name]}"
        for name, count in found["broken"].items()
        if count
    ]


def _named(row: dict[str, str]) -> str:
    return " ".join(filter(None, row.values()))

"""Two result folders or two methods side by side, on the cases that both hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import union_categoricals

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.report.columns import Column, Table
from merge_cosim.report.methods import in_order
from merge_cosim.results.statistics.comparison import clusters_of
from merge_cosim.results.statistics.paired import sign_flip_p
from merge_cosim.results.statistics.rates import bootstrap_means
from merge_cosim.results.statistics.summary import is_sample
from merge_cosim.results.store import MANIFEST, ResultFolder
from merge_cosim.scenarios.methods import is_reference
from merge_cosim.simulation.worlds.traffic import TRAFFIC

GROUP = ["scenario", "variation", "site", "source", "method"]
STATES = ["host_station_0_m", "host_speed_0", "merging_station_0_m", "merging_speed_0"]
MEASURES = {"distance_m": "D m", "delay_s": "delay s", "hardest_braking": "brake m/s²"}
"""Measures whose means are set side by side, beside the failures."""
SIDES = (("a", "A", 2), ("b", "B", 2), ("difference", "A − B", 2), ("interval", "95 % CI", None))
"""What is shown of a measure; the intervals are of the mean of the paired differences, over merging cars."""


def compare(first: Path, second: Path, methods: tuple[str, str] | None = None) -> tuple[Table, list[str]]:
    """Set two result folders side by side, or a method of one and a method of another (or the same) folder.

    Args:
        first: Folder of a finished sweep (A).
        second: Folder of another (B).
        methods: The method of each that is taken; None for all, each with the one of the same name.

    Returns:
        One row per test and method that both hold, over their common cases, with the means of the measures and of their
        paired differences A - B; and what differs between the two sweeps.

    Raises:
        UserError: One of the folders holds no finished sweep, or not its method, or they share no case.
    """
    folders = [ResultFolder(path) for path in (first, second)]
    frames = _rows(folders)
    if methods is not None:
        frames = [_of_method(*one) for one in zip(frames, methods, (first, second), strict=True)]
    group = GROUP if methods is None else GROUP[:-1]
    paired = [frame[frame["source"] != TRAFFIC] for frame in frames]
    both = paired[0].merge(paired[1], on=[*group, "case"], suffixes=("_a", "_b"))
    starts = [both[[f"{name}_{side}" for name in STATES]].to_numpy(dtype=float) for side in "ab"]
    same_start = np.isclose(starts[0], starts[1]).all(axis=1)  # other seeds draw cases of the same names
    others = int((~same_start).sum())
    both = both[same_start]
    if both.empty:
        raise UserError(
            f"{first} and {second}: they have no case of the same scenario"
            + (" and method in common; DIR:METHOD DIR:METHOD compares two methods" if methods is None else " in common")
            + " (meetings in living traffic are never the same: see the intervals of each)"
        )
    rows = [
        dict(zip(group, key, strict=True)) | _row(part) for key, part in both.groupby(group, sort=False, observed=True)
    ]
    data = pd.DataFrame(rows)
    if methods is None:
        place = {method: i for i, method in enumerate(in_order(data["method"]))}
        data = data.assign(place=data["method"].map(place)).sort_values([*GROUP[:4], "place"], ignore_index=True)
    columns = [
        *(Column(name, name) for name in group if name in ("scenario", "method") or data[name].nunique() > 1),
        Column("n", "n", 0, "common cases"),
        *(Column(f"failure_pct_{side}", f"{side.upper()} %", 2, "failures") for side in "ab"),
        Column("failure_pct_difference", "A − B %", 2, "failures"),
        Column("failure_pct_interval", "95 % CI", None, "failures", range=True),
        *(Column(f"only_{side}", f"only {side.upper()}", 0, "failures") for side in "ab"),
        Column("p", "McNemar p", 3, "failures", probability=True),
        *(
            Column(f"{name}_{side}", heading, decimals, title, range=decimals is None)
            for name, title in MEASURES.items()
            for side, heading, decimals in SIDES
        ),
    ]
    if methods is None:
        apart, title = list(map(is_reference, data["method"])), f"A: {first}, B: {second}"
    else:
        apart, title = [False] * len(data), f"A: {first}, {methods[0]}; B: {second}, {methods[1]}"
    notes = [f"{others:,} cases of the same name begin otherwise and are left out"] if others else []
    if first != second:
        notes += _differences(folders, frames, methods is None)
    return Table.of(data, columns, apart, title), notes


def _rows(folders: Sequence[ResultFolder]) -> list[pd.DataFrame]:
    """What is compared of the rows of each folder, the names that repeat as categories in common."""
    names = [*GROUP, "model"]
    columns = [*names, "case", "car", "failed", "censored", *STATES, *MEASURES]
    frames = [folder.results(columns).to_pandas(categories=names) for folder in folders]
    for name in names:
        known = union_categoricals([frame[name] for frame in frames]).categories
        for frame in frames:
            frame[name] = frame[name].cat.set_categories(known)
    return frames


def _of_method(rows: pd.DataFrame, method: str, folder: Path) -> pd.DataFrame:
    """The rows of a method, `NAME` or, where it was run with several models, `NAME@MODEL`."""
    name, _, model = method.partition("@")
    known = rows["method"].unique().tolist()
    if name not in known:
        raise UserError(f"{folder}: no method '{name}' in these results{did_you_mean(name, known)}")
    own = rows[rows["method"] == name]
    models = own["model"].unique().tolist()
    if model and model not in models:
        raise UserError(f"{folder}: no model '{model}' of '{name}' in these results{did_you_mean(model, models)}")
    own = own[own["model"] == model] if model else own
    if own.duplicated([*GROUP, "case"]).any():
        raise UserError(f"{folder}: '{name}' was run with several models; write {name}@MODEL ({', '.join(models)})")
    return own


def _row(part: pd.DataFrame) -> dict[str, Any]:
    carried = ~part["censored_a"] & ~part["censored_b"]
    scored = part[carried]
    failed = [scored[f"failed_{side}"].to_numpy(dtype=bool) for side in "ab"]
    only_a, only_b = (int((one & ~other).sum()) for one, other in (failed, failed[::-1]))
    sides = {"failure_pct": [100.0 * part[f"failed_{side}"].where(carried) for side in "ab"]}
    sides |= {name: [part[f"{name}_{side}"] for side in "ab"] for name in MEASURES}
    differences = pd.DataFrame({name: one.astype(float) - other.astype(float) for name, (one, other) in sides.items()})
    means: dict[str, Any] = {
        f"{name}_{side}": one.mean() for name, pair in sides.items() for side, one in zip("ab", pair, strict=True)
    }
    means |= {f"{name}_difference": differences[name].mean() for name in sides}
    sample = is_sample(part)
    clusters = clusters_of(part.rename(columns={"car_a": "car"}))
    intervals = bootstrap_means(differences, clusters) if sample else [(None, None)] * len(sides)
    means |= {
        f"{name}_interval": None if low is None or high is None else f"{low:.2f} – {high:.2f}".replace("-", "−")
        for name, (low, high) in zip(sides, intervals, strict=True)
    }
    if not only_a + only_b:  # every resample is the same, which is no certainty
        means["failure_pct_interval"] = None
    signs = failed[0].astype(int) - failed[1].astype(int)
    p = sign_flip_p(signs, clusters[carried].to_numpy()) if sample else None
    return {"n": len(scored), "only_a": only_a, "only_b": only_b, "p": p, **means}


def _differences(folders: list[ResultFolder], frames: list[pd.DataFrame], every: bool) -> list[str]:
    """Differences between the two sweeps that make the comparison less certain, one line each."""
    lines = []
    manifests = [folder.read_json(MANIFEST) for folder in folders]
    for name in ("versions", "seed", "models", "settings", "plugins", "ramps", "scenarios"):
        values = [manifest.get(name) for manifest in manifests]
        if values[0] != values[1]:
            lines.append(f"{name} differ: {_differing(values[0], values[1])}")
    if not every:
        return lines
    for folder, frame, other in zip(folders, frames, frames[::-1], strict=True):
        mine, theirs = (set(one[["scenario", "method"]].itertuples(index=False, name=None)) for one in (frame, other))
        only = sorted(mine - theirs)
        if only:
            lines.append(f"only in {folder.path}: " + ", ".join(f"{scenario} {method}" for scenario, method in only))
    return lines


def _differing(one: Any, other: Any) -> str:
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return f"{one} and {other}"
    keys = sorted(key for key in {*one, *other} if one.get(key) != other.get(key))
    return ", ".join(
        f"{key} ({_short(one.get(key))} and {_short(other.get(key))})" if not isinstance(one.get(key), dict) else key
        for key in keys
    )


def _short(value: Any) -> str:
    return "none" if value is None else str(value)

"""Two result folders or two methods side by side, on the cases that both hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.report.columns import Column, Table
from merge_cosim.report.methods import in_order
from merge_cosim.results.schema import SCHEMA
from merge_cosim.results.statistics.comparison import clusters_of
from merge_cosim.results.statistics.paired import sign_flip_p
from merge_cosim.results.statistics.rates import bootstrap_means
from merge_cosim.results.statistics.summary import is_sample_source
from merge_cosim.results.store import MANIFEST, ResultFolder
from merge_cosim.simulation.worlds.traffic import TRAFFIC

GROUP = ["scenario", "variation", "site", "source", "method"]
STATES = ["host_station_0_m", "host_speed_0", "merging_station_0_m", "merging_speed_0"]
MEASURES = {"distance_m": "D m", "delay_s": "delay s", "hardest_braking": "brake m/s²"}
"""Measures whose means are set side by side, beside the failures."""
COLUMNS = [*GROUP, "model", "car", "failed", "censored", *STATES, *MEASURES]
"""What is read of the rows, beside `case`."""
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
    held = [_held(folder) for folder in folders]
    sides = [_Side.of(*one) for one in zip(folders, held, methods or (None, None), strict=True)]
    group = GROUP if methods is None else GROUP[:-1]
    found: dict[tuple[str, ...], list[pd.DataFrame]] = {}
    others = 0
    for both in _common(sides, [*group, "case"]):
        starts = [both[[f"{name}_{side}" for name in STATES]].to_numpy(dtype=float) for side in "ab"]
        same_start = np.isclose(starts[0], starts[1]).all(axis=1)  # other seeds draw cases of the same names
        others += int((~same_start).sum())
        for key, part in both[same_start].groupby(group, sort=False):
            found.setdefault(key, []).append(_kept(part))
    if not found:
        raise UserError(
            f"{first} and {second}: they have no case of the same scenario"
            + (" and method in common; DIR:METHOD DIR:METHOD compares two methods" if methods is None else " in common")
            + " (meetings in living traffic are never the same: see the intervals of each)"
        )
    rows = [
        (names := dict(zip(group, key, strict=True))) | _row(parts, is_sample_source(names["source"]))
        for key, parts in found.items()
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
    title = f"A: {first}, B: {second}" if methods is None else f"A: {first}, {methods[0]}; B: {second}, {methods[1]}"
    notes = [f"{others:,} cases of the same name begin otherwise and are left out"] if others else []
    if first != second:
        notes += _differences(folders, held, methods is None)
    return Table.of(data, columns, title), notes


def _held(folder: ResultFolder) -> pd.DataFrame:
    """The scenarios, methods and models that a folder has rows of."""
    folder.check()
    names = ["scenario", "method", "model"]
    found = (rows.select(names).group_by(names).aggregate([]) for rows in folder.rows.all_batches(names))
    return pa.concat_tables([SCHEMA.empty_table().select(names), *found]).to_pandas().drop_duplicates()


@dataclass(frozen=True)
class _Side:
    """The rows of a folder that are compared; of one method and model, or of all where these are None."""

    folder: ResultFolder
    method: str | None
    model: str | None

    @classmethod
    def of(cls, folder: ResultFolder, held: pd.DataFrame, method: str | None) -> _Side:
        """Of a method, `NAME` or, where it was run with several models, `NAME@MODEL`."""
        if method is None:
            return cls(folder, None, None)
        name, _, model = method.partition("@")
        known = sorted(set(held["method"]))
        if name not in known:
            raise UserError(f"{folder.path}: no method '{name}' in these results{did_you_mean(name, known)}")
        models = held.loc[held["method"] == name, "model"].unique().tolist()
        if model and model not in models:
            hint = did_you_mean(model, models)
            raise UserError(f"{folder.path}: no model '{model}' of '{name}' in these results{hint}")
        return cls(folder, name, model or None)

    def batches(self, scenario: str, variation: str) -> Iterator[pd.DataFrame]:
        """The rows of a scenario and variation, in batches of whole cases that follow each other by name."""
        for batch in self.folder.rows.batches(scenario, variation, COLUMNS):
            rows = batch.to_pandas()
            rows = rows[rows["source"] != TRAFFIC]
            if self.method is not None:
                rows = rows[rows["method"] == self.method]
                rows = rows if self.model is None else rows[rows["model"] == self.model]
                if rows.duplicated([*GROUP, "case"]).any():
                    models = ", ".join(sorted(set(rows["model"])))
                    hint = f"'{self.method}' was run with several models; write {self.method}@MODEL ({models})"
                    raise UserError(f"{self.folder.path}: {hint}")
            if len(rows):
                yield rows


def _common(sides: Sequence[_Side], names: list[str]) -> Iterator[pd.DataFrame]:
    """The rows of both sides on the same cases, joined by `names`, a stretch of cases at a time."""
    groups = [side.folder.rows.groups() for side in sides]
    for one in groups[0]:
        if one not in groups[1]:
            continue
        streams = [side.batches(*one) for side in sides]
        ahead = [next(stream, None) for stream in streams]
        while ahead[0] is not None and ahead[1] is not None:
            last = min(rows["case"].iloc[-1] for rows in ahead if rows is not None)
            now = []
            for side, rows in enumerate(ahead):
                assert rows is not None
                until = int(rows["case"].searchsorted(last, side="right"))
                now.append(rows[:until])
                ahead[side] = rows[until:] if until < len(rows) else next(streams[side], None)
            yield now[0].merge(now[1], on=names, suffixes=("_a", "_b"))


def _kept(part: pd.DataFrame) -> pd.DataFrame:
    """What the comparison of a group rests on, of some of its rows."""
    names = [f"{name}_{side}" for name in ("failed", "censored", *MEASURES) for side in "ab"]
    named = bool((part["car_a"] != "").any())
    own = part[names].copy()  # not a view that keeps the other columns in memory
    return own.assign(cluster=clusters_of(part.rename(columns={"car_a": "car"})) if named else None)


def _row(parts: list[pd.DataFrame], sample: bool) -> dict[str, Any]:
    """The comparison of a group, whose rows come in parts; a column at a time, as there may be millions of rows."""

    def column(name: str) -> pd.Series:
        return pd.concat([part[name] for part in parts], ignore_index=True)

    carried = ~column("censored_a") & ~column("censored_b")
    failed = [column(f"failed_{side}") for side in "ab"]
    scored = [one[carried].to_numpy(dtype=bool) for one in failed]
    only_a, only_b = (int((one & ~other).sum()) for one, other in (scored, scored[::-1]))
    clusters = _clusters(column("cluster"))
    means: dict[str, Any] = {}
    for name in ("failure_pct", *MEASURES):
        if name == "failure_pct":
            sides = [100.0 * one.astype(float).where(carried) for one in failed]
        else:
            sides = [column(f"{name}_{side}") for side in "ab"]
        means |= {f"{name}_{side}": one.mean() for side, one in zip("ab", sides, strict=True)}
        difference = sides[0].astype(float) - sides[1].astype(float)
        means[f"{name}_difference"] = difference.mean()
        low, high = bootstrap_means(difference.to_frame(), clusters)[0] if sample else (None, None)
        within = None if low is None or high is None else f"{low:.2f} – {high:.2f}".replace("-", "−")
        means[f"{name}_interval"] = within
    if not only_a + only_b:  # every resample is the same, which is no certainty
        means["failure_pct_interval"] = None
    signs = scored[0].astype(int) - scored[1].astype(int)
    p = sign_flip_p(signs, None if clusters is None else clusters[carried].to_numpy()) if sample else None
    return {"n": len(signs), "only_a": only_a, "only_b": only_b, "p": p, **means}


def _clusters(names: pd.Series) -> pd.Series | None:
    """The cluster of each row, which stands alone where it has no name; None where none has one."""
    named = names.notna()
    return names.where(named, names.index.map(str)) if named.any() else None


def _differences(folders: list[ResultFolder], held: list[pd.DataFrame], every: bool) -> list[str]:
    """Differences between the two sweeps that make the comparison less certain, one line each."""
    lines = []
    manifests = [folder.read_json(MANIFEST) for folder in folders]
    for name in ("versions", "seed", "models", "settings", "plugins", "ramps", "scenarios"):
        values = [manifest.get(name) for manifest in manifests]
        if values[0] != values[1]:
            lines.append(f"{name} differ: {_differing(values[0], values[1])}")
    if not every:
        return lines
    for folder, own, other in zip(folders, held, held[::-1], strict=True):
        mine, theirs = (set(one[["scenario", "method"]].itertuples(index=False, name=None)) for one in (own, other))
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

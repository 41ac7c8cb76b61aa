"""The verdict of a test in one sentence: which method fails least, by how much, and which differences are undecided."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.results.statistics.comparison import mcnemar
from merge_cosim.results.statistics.summary import SECTION, is_sample
from merge_cosim.scenarios.methods import is_reference
from merge_cosim.simulation.worlds.traffic import TRAFFIC

LEVEL = 0.05
"""Differences with a corrected p value of at least this are undecided."""
NAMED = 4
"""Methods named after the best; the rest are counted."""


@dataclass(frozen=True)
class Verdict:
    """What is said of one test.

    Attributes:
        sentence: One or two sentences in plain text.
        order: Methods without the references: the smallest share of failed or stuck cases first, ties by mean delay.
        best: Those of them with the smallest share.
        undecided: Methods whose difference from the first is undecided; empty on a fixed grid, which is no sample.
    """

    sentence: str
    order: tuple[str, ...] = ()
    best: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Count:
    method: str
    n: int
    failed: int
    stuck: int
    delay: float

    @property
    def bad(self) -> int:
        return self.failed + self.stuck

    @property
    def share(self) -> float:
        return self.bad / self.n

    @property
    def percent(self) -> str:
        return percent(100 * self.share)


def verdict(summary: pd.DataFrame | Sequence[dict[str, Any]], rows: pd.DataFrame | None = None) -> Verdict:
    """Judge the methods of one scenario, site and source.

    Of a sample the first method is compared with every other: by McNemar's exact test on the common cases, or, without
    them (no `rows`, living traffic), by Fisher's exact test; with Holm's correction for the number of methods.

    Args:
        summary: Its summary rows, one per method, without variations.
        rows: Its result rows.
    """
    frame = pd.DataFrame(summary)
    frame = frame[~frame["method"].map(is_reference)] if len(frame) else frame
    if frame.empty:
        return Verdict("Only references were run: there is no method to judge.")
    scored = frame[frame["n"] > 0]
    counts = [_count(str(method), part) for method, part in scored.groupby("method")]
    counts.sort(key=lambda one: (one.share, one.delay, one.method))
    if not counts:
        return Verdict("No case could be scored to the end: there is nothing to judge.")
    sample = is_sample(frame)
    paired = rows if rows is not None and (frame["source"] != TRAFFIC).all() else None
    open_ = _undecided(counts, paired) if sample else ()
    order = tuple(one.method for one in counts)
    best = tuple(one.method for one in counts if one.share == counts[0].share)
    return Verdict(_sentence(counts, len(best), open_, sample), order, best, open_)


def verdicts(summary: pd.DataFrame, rows: pd.DataFrame | None = None) -> dict[tuple[str, str, str], Verdict]:
    """The verdict of each scenario, site and source of a sweep, in this order; variations are left out."""
    plain = summary[summary["variation"] == ""]
    found = {}
    for (scenario, _, site, source), part in plain.groupby(SECTION, sort=False):
        own = None
        if rows is not None:
            own = rows[(rows["scenario"] == scenario) & (rows["source"] == source) & (rows["variation"] == "")]
            own = own[own["site"] == site] if (own["site"] == site).any() else own  # site 'all' is every site
        found[str(scenario), str(site), str(source)] = verdict(part, own)
    return found


def percent(value: float) -> str:
    """A share [%] as text, with two decimals where one would show zero."""
    return f"{value:.2f} %" if 0.0 < value < 0.1 else f"{value:.1f} %"


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's correction of p values for their number, in their order."""
    corrected, largest = [0.0] * len(p_values), 0.0
    for rank, i in enumerate(sorted(range(len(p_values)), key=lambda i: p_values[i])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[i]))
        corrected[i] = largest
    return corrected


def _count(method: str, rows: pd.DataFrame) -> _Count:
    known = rows.dropna(subset=["delay_s"])
    delay = float((known["delay_s"] * known["n"]).sum() / known["n"].sum()) if len(known) else math.inf
    n, failed, stuck = (int(rows[name].sum()) for name in ("n", "failures", "stuck"))
    return _Count(method, n, failed, stuck, delay)


def _undecided(counts: Sequence[_Count], rows: pd.DataFrame | None) -> tuple[str, ...]:
    first, others = counts[0], counts[1:]
    values = [_p_value(first, other) if rows is None else _paired_p_value(first, other, rows) for other in others]
    return tuple(other.method for other, p in zip(others, holm(values), strict=True) if p >= LEVEL)


def _p_value(one: _Count, other: _Count) -> float:
    from scipy.stats import fisher_exact

    return float(fisher_exact(np.array([[one.bad, one.n - one.bad], [other.bad, other.n - other.bad]])).pvalue)


def _paired_p_value(one: _Count, other: _Count, rows: pd.DataFrame) -> float:
    scored = rows[~rows["censored"]]
    bad = {m: part.set_index("case") for m, part in scored.groupby("method") if m in (one.method, other.method)}
    both = bad[one.method].merge(bad[other.method], on="case", suffixes=("", "_other"))
    this, that = both["failed"] | both["stuck"], both["failed_other"] | both["stuck_other"]
    return mcnemar(int((this & ~that).sum()), int((~this & that).sum()))


def _sentence(counts: Sequence[_Count], tied: int, undecided: Sequence[str], sample: bool) -> str:
    first, names = counts[0], [one.method for one in counts]
    stuck = any(one.stuck for one in counts)
    what = "failed or stuck" if stuck else "failed"
    same_n = len({one.n for one in counts}) == 1
    if len(counts) == 1:
        parts = f"; {first.failed:,} failed, {first.stuck:,} stuck" if stuck else ""
        return f"{_of(first, what)} ({first.percent}){parts}. No other method to compare with."
    if tied == len(counts):
        share = f" ({first.percent})" if first.bad else ""
        number = f"each {first.bad:,} of {first.n:,} cases {what}{share}" if same_n else f"{first.percent} {what}"
        return f"No difference between {_listed(names)}: {number}."
    lead = f"{_listed(names[:tied])} {'fails' if tied == 1 else 'fail'}{' or' * stuck}"
    lead += (" gets stuck" if tied == 1 else " get stuck") * stuck
    share = f" ({first.percent})" if first.bad else ""
    text = f"{lead} least: {first.bad:,} of {first.n:,} cases{' each' * (tied > 1 and same_n)}{share}"
    others = counts[tied:]
    named = others[:NAMED] if len(others) > NAMED + 1 else others
    text += "".join(f"; {one.method} {_number(one, same_n)}" for one in named)
    if len(others) > len(named):
        text += f"; {len(others) - len(named)} more up to {_number(others[-1], same_n)} ({others[-1].method})"
    return f"{text}. {_certainty(names, tied, undecided, sample)}"


def _certainty(names: Sequence[str], tied: int, undecided: Sequence[str], sample: bool) -> str:
    if not sample:
        return "The cases are a fixed grid, so these are counts without chance."
    if not undecided:
        return f"Every difference from {names[0]} is beyond chance (p < {LEVEL:g}, Holm)."
    if len(undecided) == len(names) - 1:
        return f"All differences from {names[0]} are undecided (p ≥ {LEVEL:g}, Holm)."
    open_ = [name for name in names[tied:] if name in undecided]
    if not open_:
        return f"Every difference of {_listed(names[:tied])} from the others is beyond chance (p < {LEVEL:g}, Holm)."
    return f"Differences between {names[0]} and {_listed(open_)} are undecided (p ≥ {LEVEL:g}, Holm)."


def _of(one: _Count, what: str) -> str:
    return f"{one.method}: {one.bad:,} of {one.n:,} cases {what}"


def _number(one: _Count, same_n: bool) -> str:
    return f"{one.bad:,}{'' if same_n else f' of {one.n:,}'} ({one.percent})"


def _listed(names: Sequence[str]) -> str:
    if len(names) > NAMED + 1:
        names = [*names[:NAMED], f"{len(names) - NAMED} more"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"

"""The verdict of a test in one sentence: which method fails least, by how much, and which differences are undecided."""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.results.statistics.comparison import clusters_of
from merge_cosim.results.statistics.paired import holm, sign_flip_p
from merge_cosim.results.statistics.summary import SECTION, is_sample
from merge_cosim.scenarios.methods import is_reference
from merge_cosim.simulation.worlds.traffic import TRAFFIC

LEVEL = 0.05
"""Differences with a corrected p value of at least this are undecided."""
NAMED = 4
"""Methods named after the best; the rest are counted."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on one test.

    Attributes:
        sentence: One or two sentences in plain text.
        order: Methods without the references: the smallest share of failed or stuck cases first, ties by mean delay.
            A method that was run with several models is judged by its median model.
        best: Those of them with the smallest share.
        undecided: Methods whose difference from the first is undecided: by chance, or because it depends on the
            trained model. A fixed grid is no sample, so there chance does not count.
    """

    sentence: str
    order: tuple[str, ...] = ()
    best: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()

    @property
    def headline(self) -> str:
        """The sentence up to what follows the best."""
        return re.split(r"; |\. ", self.sentence)[0].rstrip(".")


@dataclass(frozen=True)
class _Count:
    """Counts of one method's cases; a method with several models has an entry per model."""

    method: str
    n: int
    failed: int
    stuck: int
    delay: float
    model: str = ""

    @property
    def bad(self) -> int:
        return self.failed + self.stuck

    @property
    def share(self) -> float:
        return self.bad / self.n


@dataclass(frozen=True)
class _Standing:
    """A method by its median model."""

    counts: tuple[_Count, ...]

    @property
    def method(self) -> str:
        return self.counts[0].method

    @property
    def share(self) -> float:
        return median(one.share for one in self.counts)

    @property
    def delay(self) -> float:
        return median(one.delay for one in self.counts)

    @property
    def percent(self) -> str:
        if len(self.counts) == 1:
            return percent(100 * self.share)
        low, high = (100 * pick(one.share for one in self.counts) for pick in (min, max))
        return f"median {percent(100 * self.share)}, {low:.1f}–{high:.1f} % over {len(self.counts)} models"

    def number(self, with_n: bool) -> str:
        one = self.counts[0]
        if len(self.counts) > 1:
            return self.percent
        return f"{one.bad:,}{f' of {one.n:,}' if with_n else ''} ({self.percent})"


def verdict(summary: pd.DataFrame | Sequence[dict[str, Any]], rows: pd.DataFrame | None = None) -> Verdict:
    """Judge the methods of one scenario, site and source.

    Of a sample the first method is compared with every other: by McNemar's exact test on the common cases, or, without
    them (no `rows`, living traffic), by Fisher's exact test; with Holm's correction for the number of methods.
    """
    frame = pd.DataFrame(summary)
    frame = frame[~frame["method"].map(is_reference)] if len(frame) else frame
    if frame.empty:
        return Verdict("Only references were run: there is no method to judge.")
    found: dict[str, list[_Count]] = {}
    for row in frame[frame["n"] > 0].to_dict("records"):
        found.setdefault(str(row["method"]), []).append(_count(row))
    standings = sorted(
        (_Standing(tuple(v)) for v in found.values()), key=lambda one: (one.share, one.delay, one.method)
    )
    if not standings:
        return Verdict("No case could be scored to the end: there is nothing to judge.")
    sample = is_sample(frame)
    paired = rows if rows is not None and (frame["source"] != TRAFFIC).all() else None
    open_ = _undecided(standings, paired, sample)
    order = tuple(one.method for one in standings)
    best = tuple(one.method for one in standings if one.share == standings[0].share)
    return Verdict(_sentence(standings, len(best), open_, sample), order, best, open_)


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


def _count(row: Mapping[Hashable, Any]) -> _Count:
    delay = math.inf if pd.isna(row["delay_s"]) else float(row["delay_s"])
    return _Count(
        str(row["method"]), int(row["n"]), int(row["failures"]), int(row["stuck"]), delay, str(row.get("model", ""))
    )


def _undecided(standings: Sequence[_Standing], rows: pd.DataFrame | None, sample: bool) -> tuple[str, ...]:
    first, others = standings[0], standings[1:]
    if not sample and all(len(one.counts) == 1 for one in standings):
        return ()
    values = [_p_value(first, other, rows, sample) for other in others]
    return tuple(other.method for other, p in zip(others, holm(values), strict=True) if p >= LEVEL)


def _p_value(first: _Standing, other: _Standing, rows: pd.DataFrame | None, sample: bool) -> float:
    """The largest p value over common models; 1 where these disagree on the better method or are none; 0 on a grid."""
    pairs = [(a, b) for a in first.counts for b in other.counts if a.model == b.model or not (a.model and b.model)]
    signs = {bool(a.share < b.share) for a, b in pairs if a.share != b.share}
    if len(pairs) != 1 and len(signs) != 1:
        return 1.0
    if not sample:
        return 0.0
    return max((_fisher(a, b) if rows is None else _paired(a, b, rows) for a, b in pairs), default=1.0)


def _fisher(one: _Count, other: _Count) -> float:
    from scipy.stats import fisher_exact

    return float(fisher_exact(np.array([[one.bad, one.n - one.bad], [other.bad, other.n - other.bad]])).pvalue)


def _paired(one: _Count, other: _Count, rows: pd.DataFrame) -> float:
    scored = rows[~rows["censored"]]
    this, that = (scored[(scored["method"] == who.method) & (scored["model"] == who.model)] for who in (one, other))
    both = this.merge(that, on="case", suffixes=("", "_other"))
    bad, bad_other = both["failed"] | both["stuck"], both["failed_other"] | both["stuck_other"]
    return sign_flip_p((bad.astype(int) - bad_other.astype(int)).to_numpy(), clusters_of(both).to_numpy())


def _sentence(standings: Sequence[_Standing], tied: int, undecided: Sequence[str], sample: bool) -> str:
    names = [one.method for one in standings]
    one = standings[0].counts[0]
    stuck = any(count.stuck for standing in standings for count in standing.counts)
    what = "failed or stuck" if stuck else "failed"
    same_n = len({count.n for standing in standings for count in standing.counts}) == 1
    several = any(len(standing.counts) > 1 for standing in standings)
    zero = not standings[0].share and len(standings[0].counts) == 1
    if len(standings) == 1:
        if several:
            return f"{names[0]}: {standings[0].percent} of {one.n:,} cases {what}. No other method to compare with."
        parts = f"; {one.failed:,} failed, {one.stuck:,} stuck" if stuck else ""
        share = standings[0].percent
        return f"{names[0]}: {one.bad:,} of {one.n:,} cases {what} ({share}){parts}. No other method to compare with."
    if tied == len(standings):
        share = "" if zero else f" ({standings[0].percent})"
        number = f"each {one.bad:,} of {one.n:,} cases {what}{share}" if same_n and not several else ""
        same = number or f"{standings[0].percent} {what}"
        return f"No difference between {_listed(names)}: {same}{_soonest(standings)}."
    lead = f"{_listed(names[:tied])} {'fails' if tied == 1 else 'fail'}{' or' * stuck}"
    lead += (" gets stuck" if tied == 1 else " get stuck") * stuck
    each = " each" * (tied > 1 and same_n)
    text = f"{lead} least: {one.bad:,} of {one.n:,} cases{each}" + ("" if zero else f" ({standings[0].percent})")
    if len(standings[0].counts) > 1:
        text = f"{lead} least: {standings[0].percent} of {one.n:,} cases{each}"
    text += _soonest(standings[:tied])
    others = standings[tied:]
    named = others[:NAMED] if len(others) > NAMED + 1 else others
    text += "".join(f"; {other.method} {other.number(not same_n)}" for other in named)
    if len(others) > len(named):
        text += f"; {len(others) - len(named)} more up to {others[-1].number(not same_n)} ({others[-1].method})"
    return f"{text}. {_certainty(names, tied, undecided, sample, several)}"


def _soonest(tied: Sequence[_Standing]) -> str:
    """Which of the methods that fail equally often has the least mean delay; empty where there is none to name."""
    if len(tied) == 1 or tied[0].share == 1.0:
        return ""
    if any(len(one.counts) > 1 or one.counts[0].stuck or one.delay == math.inf for one in tied):
        return ""
    least, following = (f"{one.delay:.2f} s" for one in tied[:2])
    if least == following:
        return ""
    return f", {tied[0].method} with the least mean delay of these ({least}, then {tied[1].method} {following})"


def _certainty(names: Sequence[str], tied: int, undecided: Sequence[str], sample: bool, several: bool) -> str:
    if not sample and not several:
        return "The cases are a fixed grid: the counts are exact for it, not a sample."
    open_ = [name for name in names[tied:] if name in undecided]
    who = names[0] if tied == 1 or open_ else _listed(names[:tied])
    if not sample:
        if not open_:
            return f"Every trained model agrees that {names[0]} is best."
        return f"Which of {names[0]} and {_listed(open_)} is better depends on the trained model."
    if not open_:
        return f"Every difference of {who} from the others is beyond chance (p < {LEVEL:g}, Holm)."
    if len(open_) == len(names) - tied:
        return f"All differences from {who} are undecided (p ≥ {LEVEL:g}, Holm)."
    return f"Differences between {who} and {_listed(open_)} are undecided (p ≥ {LEVEL:g}, Holm)."


def _listed(names: Sequence[str]) -> str:
    if len(names) > NAMED + 1:
        names = [*names[:NAMED], f"{len(names) - NAMED} more"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"

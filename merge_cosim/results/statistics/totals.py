"""Sums over the rows of a group, batch by batch, so that a summary never needs all rows at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from merge_cosim.core.units import FloatArray
from merge_cosim.results.statistics.rates import MOST_CLUSTERS, Interval, Moments, bootstrap_sums


@dataclass
class Sum:
    """Number and sum of the known values."""

    known: int = 0
    total: float = 0.0

    def add(self, values: FloatArray) -> None:
        """Add the values of a batch; NaN is missing."""
        present = values[~np.isnan(values)]
        self.join(Sum(len(present), float(present.sum())))

    def join(self, other: Sum) -> None:
        """Add another one."""
        self.known += other.known
        self.total += other.total

    def mean(self, factor: float = 1.0) -> float | None:
        """Mean of the known values, times a factor."""
        return round(factor * (self.total / self.known), 6) if self.known else None

    def count(self) -> int | None:
        """How many of the known values are true; None without any."""
        return int(self.total) if self.known else None


@dataclass
class Tail:
    """A low quantile of the known values, exact: it keeps as many of the smallest values as the quantile can need.

    Attributes:
        q: Which quantile.
        known: Number of values.
        smallest: The smallest of them.
    """

    q: float
    known: int = 0
    smallest: FloatArray = field(default_factory=lambda: np.empty(0))

    def add(self, values: FloatArray, most: int) -> None:
        """Add the known values of a batch; `most` is the most values that all batches may have."""
        present = values[~np.isnan(values)]
        self.join(Tail(self.q, len(present), present), most)

    def join(self, other: Tail, most: int) -> None:
        """Add another one."""
        self.known += other.known
        self.smallest = np.concatenate([self.smallest, other.smallest])
        room = int(self.q * max(most - 1, 0)) + 2
        if len(self.smallest) > room:
            self.smallest = np.partition(self.smallest, room - 1)[:room]

    def value(self) -> float:
        """The quantile, between two values in proportion; `known` must not be 0."""
        ordered = np.sort(self.smallest)
        place = self.q * (self.known - 1)
        low = int(place)
        high = min(low + 1, self.known - 1)
        return float(ordered[low] + (place - low) * (ordered[high] - ordered[low]))


@dataclass
class Clusters:
    """Sums of some columns over the clusters that rows belong to, for intervals of their means.

    Attributes:
        whole: No cluster has rows in two batches, so that many clusters can be held as moments.
        parts: Sums and numbers of known values by cluster, a pair of each batch.
        moments: Of each column, of clusters that are no longer held.
        rows: Number of rows.
    """

    whole: bool = True
    parts: list[tuple[pd.DataFrame, pd.DataFrame]] = field(default_factory=list)
    moments: list[Moments] | None = None
    rows: int = 0

    def add(self, values: pd.DataFrame, clusters: pd.Series, whole: bool) -> None:
        """Add the rows of a batch.

        Args:
            values: One column per mean.
            clusters: Which rows belong together.
            whole: None of these clusters has rows in another batch.
        """
        numbers = values.astype(float)
        known = numbers.notna().astype(int)
        if whole and len(clusters) > MOST_CLUSTERS and clusters.is_unique:
            sums, counts = numbers.fillna(0.0), known
        else:
            by = clusters.to_numpy()
            sums, counts = numbers.groupby(by).sum(), known.groupby(by).sum()
        self.join(Clusters(whole, [(sums, counts)], rows=len(values)))

    def join(self, other: Clusters) -> None:
        """Add another one."""
        self.whole &= other.whole
        self.rows += other.rows
        self.parts += other.parts
        self.moments = _joined(self.moments, other.moments)
        if self.whole and sum(len(sums) for sums, _ in self.parts) > MOST_CLUSTERS:
            self._fold()

    @property
    def number(self) -> int:
        """Number of clusters."""
        held = len(self._held()[0]) if self.parts else 0
        return held + (self.moments[0].clusters if self.moments else 0)

    def intervals(self) -> Sequence[Interval]:
        """The 95 % interval of the mean of each column, see `bootstrap_means`."""
        if self.moments is None:
            return bootstrap_sums(*self._held())
        if self.parts:
            self._fold()
        return [moments.interval() for moments in self.moments]

    def _held(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        if len(self.parts) > 1:
            sums, counts = (pd.concat(each) for each in zip(*self.parts, strict=True))
            self.parts = [(sums.groupby(level=0).sum(), counts.groupby(level=0).sum())]
        return self.parts[0]

    def _fold(self) -> None:
        for sums, counts in self.parts:
            own = [Moments.of(sums[name].to_numpy(), counts[name].to_numpy()) for name in sums]
            self.moments = _joined(self.moments, own)
        self.parts = []


def _joined(one: list[Moments] | None, other: list[Moments] | None) -> list[Moments] | None:
    if one is None or other is None:
        return one or other
    return [first + second for first, second in zip(one, other, strict=True)]


@dataclass
class Totals:
    """Sums over the rows of a group.

    Attributes:
        most: Most rows that there will be.
        numbers: How many rows are of each kind.
        sums: Of columns.
        tails: Low quantiles of columns; of high ones those of the values with the other sign.
        clusters: Failures and D by merging car, or by case where these are not logged.
        logged: Every row has a merging car of a log.
        differing: Cases on which this method and the one it is compared with differ in failing, and their clusters.
        compared: There were cases to compare.
    """

    most: int
    numbers: Counter[str] = field(default_factory=Counter)
    sums: dict[str, Sum] = field(default_factory=dict)
    tails: dict[str, Tail] = field(default_factory=dict)
    clusters: Clusters = field(default_factory=Clusters)
    logged: bool = True
    differing: list[pd.DataFrame] = field(default_factory=list)
    compared: bool = False

    def join(self, other: Totals) -> None:
        """Add another one."""
        self.numbers.update(other.numbers)
        for name, total in other.sums.items():
            self.sums.setdefault(name, Sum()).join(total)
        for name, tail in other.tails.items():
            self.tails.setdefault(name, Tail(tail.q)).join(tail, self.most)
        self.clusters.join(other.clusters)
        self.logged &= other.logged
        self.differing += other.differing
        self.compared |= other.compared

"""Counts, shares and means with their 95 % intervals; None where they are undefined."""

from __future__ import annotations

from functools import lru_cache
from math import sqrt
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd

from merge_cosim.core.units import FloatArray, IntArray

RESAMPLES = 1_000
SEED = 0
"""Of the bootstrap: the same rows always have the same intervals."""
LEVELS = (0.025, 0.975)
Z = 1.959963984540054
MOST_CLUSTERS = 10_000
"""With more clusters than this the normal approximation takes the bootstrap's place: as good, and it needs no room."""

Interval = tuple[float | None, float | None]


def wilson(part: int, whole: int) -> Interval:
    """Wilson's 95 % interval of a share [%], as SciPy gives it after half a second of importing."""
    if not whole:
        return None, None
    share, square = part / whole, Z * Z / whole
    middle, half = share + square / 2, Z * sqrt(share * (1 - share) / whole + square / whole / 4)
    ends = (max(middle - half, 0.0) / (1 + square), min(middle + half, 1 + square) / (1 + square))
    return round(100 * ends[0], 4), round(100 * ends[1], 4)


def bootstrap_means(values: pd.DataFrame, clusters: pd.Series | None) -> list[Interval]:
    """Percentile bootstrap 95 % intervals of the mean of each column, whole clusters drawn with replacement.

    All columns share the same draws, which is why this is a matrix product and not `scipy.stats.bootstrap` column by
    column (with whose intervals it agrees).

    Args:
        values: One column per mean; missing values do not count.
        clusters: Which rows belong together: those of one merging car. None: none do, which is the plain bootstrap.
    """
    if clusters is None and len(values) > MOST_CLUSTERS:  # as below, but there may be millions of rows
        columns = (one.to_numpy(dtype=np.float64, na_value=np.nan) for _, one in values.items())
        known = ((one, ~np.isnan(one)) for one in columns)
        return [Moments.of(np.where(here, one, 0.0), here.astype(np.int64)).interval() for one, here in known]
    numbers = values.astype(float)
    by = np.arange(len(values)) if clusters is None else clusters.to_numpy()
    return bootstrap_sums(numbers.groupby(by).sum(), numbers.notna().groupby(by).sum())


def bootstrap_sums(sums: pd.DataFrame, counts: pd.DataFrame) -> list[Interval]:
    """The same from the sum and the number of known values of each cluster, a row per cluster, ordered by it."""
    if len(sums) < 2:
        return [(None, None)] * sums.shape[1]
    if len(sums) > MOST_CLUSTERS:
        return [Moments.of(sums[name].to_numpy(), counts[name].to_numpy()).interval() for name in sums]
    weights = _weights(len(sums))
    drawn = weights @ counts.to_numpy(dtype=float)
    means = np.divide(weights @ sums.to_numpy(), drawn, out=np.full_like(drawn, np.nan), where=drawn > 0)
    found: list[Interval] = []
    for column in means.T:
        known = column[~np.isnan(column)]
        low, high = np.quantile(known, LEVELS) if len(known) else (None, None)
        found.append((None, None) if low is None or high is None else (float(low), float(high)))
    return found


class Moments(NamedTuple):
    """Sums over many clusters, of which s is the sum and c the number of known values of each."""

    clusters: int
    s: float
    c: float
    s_s: float
    s_c: float
    c_c: float

    @classmethod
    def of(cls, sums: FloatArray, counts: IntArray) -> Self:
        """Of clusters, shape (n,) each."""
        squares = (np.sum(one * other) for one, other in ((sums, sums), (sums, counts), (counts, counts)))
        return cls(len(sums), float(sums.sum()), float(counts.sum()), *map(float, squares))

    def __add__(self, other: tuple[Any, ...]) -> Self:
        """Of the clusters of both."""
        return type(self)(*(one + another for one, another in zip(self, other, strict=True)))

    def interval(self) -> Interval:
        """Interval of the ratio of the two totals, from the spread of what each cluster adds."""
        n, total = self.clusters, self.c
        if not total or n < 2:
            return None, None
        ratio = self.s / total
        spread = max(self.s_s - 2 * ratio * self.s_c + ratio**2 * self.c_c, 0.0)
        half = Z * np.sqrt(n / (n - 1) * spread) / total
        return float(ratio - half), float(ratio + half)


@lru_cache(maxsize=2)
def _weights(clusters: int) -> FloatArray:
    """How often each cluster is drawn in each resample, shape (RESAMPLES, clusters)."""
    rng = np.random.default_rng(SEED)
    draws = (rng.integers(clusters, size=clusters) for _ in range(RESAMPLES))
    return np.array([np.bincount(draw, minlength=clusters) for draw in draws], dtype=float)


def percent(part: int, whole: int) -> float | None:
    """A share [%]."""
    return round(100 * part / whole, 4) if whole else None

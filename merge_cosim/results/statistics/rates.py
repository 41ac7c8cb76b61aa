"""Counts, shares and means with their 95 % intervals; None where they are undefined."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pandas as pd

from merge_cosim.core.units import FloatArray, IntArray

RESAMPLES = 1_000
SEED = 0
"""Of the bootstrap: the same rows always have the same intervals."""
LEVELS = (0.025, 0.975)
Z = 1.959964
MOST_CLUSTERS = 10_000
"""With more clusters than this the normal approximation takes the bootstrap's place: as good, and it needs no room."""

Interval = tuple[float | None, float | None]


def wilson(part: int, whole: int) -> Interval:
    """Wilson's 95 % interval of a share [%]."""
    from scipy.stats import binomtest  # half a second to import, which a worker process need not pay

    if not whole:
        return None, None
    interval = binomtest(part, whole).proportion_ci(method="wilson")
    return round(100 * interval.low, 4), round(100 * interval.high, 4)


def bootstrap_means(values: pd.DataFrame, clusters: pd.Series) -> list[Interval]:
    """Percentile bootstrap 95 % intervals of the mean of each column, whole clusters drawn with replacement.

    All columns share the same draws, which is why this is a matrix product and not `scipy.stats.bootstrap` column by
    column (with whose intervals it agrees).

    Args:
        values: One column per mean; missing values do not count.
        clusters: Which rows belong together: those of one merging car. Single rows are the plain bootstrap.
    """
    numbers = values.astype(float)
    sums = numbers.groupby(clusters.to_numpy()).sum()
    counts = numbers.notna().groupby(clusters.to_numpy()).sum()
    if len(sums) < 2:
        return [(None, None)] * numbers.shape[1]
    if len(sums) > MOST_CLUSTERS:
        return [_normal(sums[name].to_numpy(), counts[name].to_numpy()) for name in numbers]
    weights = _weights(len(sums))
    drawn = weights @ counts.to_numpy(dtype=float)
    means = np.divide(weights @ sums.to_numpy(), drawn, out=np.full_like(drawn, np.nan), where=drawn > 0)
    found: list[Interval] = []
    for column in means.T:
        known = column[~np.isnan(column)]
        low, high = np.quantile(known, LEVELS) if len(known) else (None, None)
        found.append((None, None) if low is None or high is None else (float(low), float(high)))
    return found


def _normal(sums: FloatArray, counts: IntArray) -> Interval:
    """Interval of the ratio of two totals over many clusters, from the spread of what each adds."""
    n, total = len(sums), counts.sum()
    if not total:
        return None, None
    ratio = sums.sum() / total
    half = Z * np.sqrt(n / (n - 1) * np.sum((sums - ratio * counts) ** 2)) / total
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


def mean(values: pd.Series, factor: float = 1.0) -> float | None:
    """Mean of what is known, times a factor."""
    present = values.dropna().astype(float)
    return round(factor * float(present.mean()), 6) if len(present) else None


def quantile(values: pd.Series, q: float) -> float | None:
    """Quantile of what is known."""
    present = values.dropna()
    return round(float(present.quantile(q)), 6) if len(present) else None


def count(values: pd.Series) -> int | None:
    """How many of what is known are true."""
    present = values.dropna()
    return int(present.sum()) if len(present) else None

"""Two methods on the same cases, which may belong together: those of one merging car are not independent."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
import pandas as pd

from merge_cosim.core.units import AnyArray
from merge_cosim.results.statistics.rates import Interval, bootstrap_means

EXACT_CLUSTERS = 14
"""Up to so many clusters with a difference all patterns of signs are counted; with more, a seeded sample of them."""
SIGN_DRAWS = 20_000
SEED = 0


def sign_flip_p(differences: AnyArray, clusters: AnyArray | None) -> float:
    """Two-sided p value of a paired test that keeps clusters together (sign-flip permutation test).

    If neither method is better, the sum of the differences within a cluster has either sign with the same probability.
    With one case per cluster and differences of -1, 0 and 1 this is McNemar's exact test.

    Args:
        differences: Value of the first method minus that of the second on each case, shape (n,).
        clusters: Which cases belong together, shape (n,); None: none do.
    """
    sums = np.asarray(differences, dtype=float)
    if clusters is not None:
        _, index = np.unique(np.asarray(clusters, dtype=str), return_inverse=True)
        sums = np.bincount(index, sums)
    size, observed = np.abs(sums[sums != 0]), abs(float(sums.sum()))
    if not len(size):
        return 1.0
    if len(size) <= EXACT_CLUSTERS:
        signs = np.array(list(product((-1.0, 1.0), repeat=len(size))))
        return float((np.abs((signs * size).sum(axis=1)) >= observed - 1e-9).mean())
    if np.ptp(size) == 0:  # all alike, so the binomial distribution counts the patterns
        from scipy.stats import binomtest

        positive = round((len(size) + observed / size[0]) / 2)
        return float(binomtest(positive, len(size), 0.5).pvalue)
    signs = np.random.default_rng(SEED).choice((-1.0, 1.0), size=(SIGN_DRAWS, len(size)))
    reached = int((np.abs((signs * size).sum(axis=1)) >= observed - 1e-9).sum())
    return (reached + 1) / (SIGN_DRAWS + 1)


def mean_difference(first: pd.Series, second: pd.Series, clusters: pd.Series) -> tuple[float, Interval]:
    """Mean of the first minus the second over the common cases, and its bootstrap 95 % interval over clusters."""
    difference = first.astype(float) - second.astype(float)
    known = difference.notna()
    (interval,) = bootstrap_means(difference[known].to_frame(), clusters[known])
    return float(difference[known].mean()), interval


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's correction of p values for their number, in their order."""
    corrected, largest = [0.0] * len(p_values), 0.0
    for rank, i in enumerate(sorted(range(len(p_values)), key=lambda i: p_values[i])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[i]))
        corrected[i] = largest
    return corrected

"""Quality of the beliefs at fixed distances of the merging car, in closed loop: accuracy, AUC, Brier, log loss."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from merge_cosim.core.units import BoolArray, FloatArray
from merge_cosim.results.statistics.summary import ALL_STARTS, GROUP, by_start, with_all_sites
from merge_cosim.scoring.decisions import GATES

COLUMNS = (
    *GROUP,
    "label",
    "ambiguity_s",
    *(f"{name}_{gate}" for gate in GATES for name in ("log_odds", "arrival_lead")),
)
"""Columns of result rows that these tables are made of."""
BINS = 10
"""Bins of P(NOT_YIELD) by which calibration is judged."""


def belief(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per group, start (all, and by ambiguity) and gate; empty where no case has a label.

    `n` cases have a label and pass the gate undecided. A rule without probabilities has an accuracy only; `auc_arrival`
    is the AUC of T_h - T_m at the same gates of the same runs, and so how much the geometry alone decides there.
    """
    found = []
    for key, start, group in _groups(rows):
        for gate in GATES:
            known = group[group[f"log_odds_{gate}"].notna()]
            if len(known):
                odds, lead = known[f"log_odds_{gate}"].to_numpy(), known[f"arrival_lead_{gate}"].to_numpy()
                truth = (known["label"] == "NOT_YIELD").to_numpy()
                scored = scores(odds, truth) | {"auc_arrival": auc(lead, truth)}
                found.append(key | {"start": start, "gate_m": gate} | scored)
    return pd.DataFrame(found)


def calibration(rows: pd.DataFrame) -> pd.DataFrame:
    """Counts, mean belief and observed share of NOT_YIELD by bin of belief: one row per group, gate and filled bin."""
    found = []
    for key, start, group in _groups(rows):
        if start != ALL_STARTS:
            continue
        for gate in GATES:
            known = group[np.isfinite(group[f"log_odds_{gate}"].to_numpy(dtype=float))]
            odds, truth = known[f"log_odds_{gate}"].to_numpy(), (known["label"] == "NOT_YIELD").to_numpy()
            for low, high, n, mean, share in filled_bins(odds, truth):
                found.append(
                    key | {"gate_m": gate, "from": low, "to": high, "n": n}
                    | {"mean_belief": round(mean, 6), "not_yield_share": round(share, 6)}
                )  # fmt: skip
    return pd.DataFrame(found)


def scores(log_odds: FloatArray, truth: BoolArray) -> dict[str, Any]:
    """Score beliefs against labels.

    Args:
        log_odds: `log P(NOT_YIELD) - log P(YIELD)`, shape (n,), n > 0.
        truth: The label is NOT_YIELD, shape (n,).
    """
    from scipy.special import expit

    found: dict[str, Any] = {
        "n": len(truth),
        "not_yield": int(truth.sum()),
        "accuracy_pct": round(100 * float(((log_odds >= 0) == truth).mean()), 4),
        **dict.fromkeys(("auc", "brier", "log_loss", "calibration_error")),
    }
    if np.isinf(log_odds).all():
        return found
    surprise = float(np.logaddexp(0.0, np.where(truth, -log_odds, log_odds)).mean())
    errors = [n * abs(mean - share) for _, _, n, mean, share in filled_bins(log_odds, truth)]
    found["brier"] = round(float(np.mean((expit(log_odds) - truth) ** 2)), 6)
    found["log_loss"] = round(surprise, 6) if np.isfinite(surprise) else None
    found["calibration_error"] = round(sum(errors) / len(truth), 6)
    found["auc"] = auc(log_odds, truth)
    return found


def auc(score: FloatArray, truth: BoolArray) -> float | None:
    """Area under the ROC curve of a score for NOT_YIELD, by its ranks (ties count half); None for a single label."""
    positive = int(truth.sum())
    pairs = positive * (len(truth) - positive)
    _, place, count = np.unique(np.nan_to_num(score), return_inverse=True, return_counts=True)
    ranks = (np.cumsum(count) - (count - 1) / 2)[place]
    above = ranks[truth].sum() - positive * (positive + 1) / 2
    return round(float(above / pairs), 6) if pairs else None


def filled_bins(
    log_odds: FloatArray, truth: BoolArray, count: int = BINS
) -> Iterator[tuple[float, float, int, float, float]]:
    """Both edges, number of cases, mean P(NOT_YIELD) and share of NOT_YIELD of each bin that is not empty."""
    from scipy.special import expit

    probability = expit(log_odds)
    bins = np.minimum((probability * count).astype(int), count - 1)
    for number in np.unique(bins).tolist():
        here = bins == number
        edges = number / count, (number + 1) / count
        yield *edges, int(here.sum()), float(probability[here].mean()), float(truth[here].mean())


def _groups(rows: pd.DataFrame) -> Iterator[tuple[dict[str, str], str, pd.DataFrame]]:
    frame = rows[rows["label"] != ""]
    for key, group in with_all_sites(frame).groupby(GROUP, sort=True):
        names = dict(zip(GROUP, map(str, key), strict=True))
        yield names, ALL_STARTS, group
        if not names["variation"]:
            for start, part in by_start(group):
                yield names, start, part

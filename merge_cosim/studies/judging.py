"""Judging a model on merging cars not trained on: its estimators frame by frame, its densities by transition."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.core.units import DT, BoolArray, FloatArray
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.learned.fitting import transitions
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.pgm import Pgm
from merge_cosim.estimators.pgm_g import PgmG
from merge_cosim.results.statistics.belief import auc, filled_bins, scores

DISTANCES = ((0.0, 40.0), (40.0, 70.0), (70.0, 110.0), (110.0, np.inf))
"""Bands of the merging car's distance to the merging point [m], by which estimates are judged."""
SPEED_BAND = 5.0
"""Width of the bands of V_{t-1} [m/s], by which densities are judged."""
PROBABILITY_BINS = 5
"""Bins of P(NOT_YIELD) by which calibration is judged."""
JUDGED = (
    *("pgm", "pgm-symmetric", "pgm-time", "pgm-speed", "pgm-g", "fg", "fg-time"),
    *("fg-gmm", "fg-gmm-time", "fg-gmm-joint", "slot-time"),
)
DENSITIES = ("histogram", "gaussian", "mixture")


@dataclass(frozen=True)
class Watched:
    """Output of an estimator for every frame in which neither car had reached the merging point.

    Attributes:
        log_odds: Log-odds of NOT_YIELD, shape (frames,).
        distance: The merging car's distance to the merging point [m], shape (frames,).
        margin: `T_h - T_m` [s], shape (frames,).
        not_yield: The label, shape (frames,).
    """

    log_odds: FloatArray
    distance: FloatArray
    margin: FloatArray
    not_yield: BoolArray

    def between(self, near: float, far: float) -> Watched:
        """The frames with the merging car at `near` to `far` [m]."""
        here = (self.distance >= near) & (self.distance < far)
        return Watched(self.log_odds[here], self.distance[here], self.margin[here], self.not_yield[here])


def logged(encounters: Encounters) -> Iterator[tuple[Observation, BoolArray]]:
    """What a host would observe where both cars drive as logged, cycle by cycle.

    With it, where the log goes on and neither car has reached the merging point, shape (n,); the last cycle of a log
    that is over is repeated.
    """
    log = encounters.log
    assert log is not None
    both = np.minimum(log.merging_station.lengths, log.host_station.lengths)
    for cycle in range(int(both.max()) - 1):
        now = np.minimum(cycle, both - 2)
        host, merging = log.host_station, log.merging_station
        at_host, at_merging = host.offsets[:-1] + now, merging.offsets[:-1] + now
        seen = Observation(
            host_station=host.values[at_host],
            host_speed=np.maximum(host.values[at_host + 1] - host.values[at_host], 0.0) / DT,
            merging_station=merging.values[at_merging],
            merging_speed=log.merging_speed.values[at_merging],
            host_length=encounters.host_length,
            merging_length=encounters.merging_length,
        )
        yield seen, (cycle < both - 1) & (seen.host_station < 0) & (seen.merging_station < 0)


def open_loop(estimator: Estimator, encounters: Encounters) -> Watched:
    """Run an estimator on the logs, without driving."""
    n = len(encounters)
    estimator.start(n, Setting())
    estimator.reset(np.arange(n), encounters.label, stream_keys(encounters.case, 0))
    parts = []
    for seen, use in logged(encounters):
        odds = estimator.update(seen)
        margin = seen.host_arrival - seen.merging_arrival
        parts.append((odds[use], -seen.merging_station[use], margin[use], encounters.label[use] == Intention.NOT_YIELD))
    return Watched(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def judge(model: IntentionModel, held_out: Encounters) -> dict[str, list[dict[str, Any]]]:
    """Judge each estimator's frames on held-out pairs, by distance of the merging car; both cars drive as logged.

    Frames of one pair are not independent of each other.

    Returns:
        `scores`: accuracy, log loss, AUC and Brier score of each estimator and band; of a rule without
        probabilities only accuracy, and the AUC of `T_h - T_m`. `calibration`: share of the drivers of each band that
        did not yield, by bins of the estimator's probability.
    """
    scored, calibrated = [], []
    for name in JUDGED:
        estimator = estimators[name]()
        if estimator.needs_model:
            estimator.use(model)
        watched = open_loop(estimator, held_out)
        for near, far in DISTANCES:
            here = watched.between(near, far)
            if len(here.log_odds):
                where = {"estimator": name, "distance_m": f"{near:g}-{far:g}"}
                scored.append(where | score(here))
                calibrated += [where | row for row in calibration(here)]
    return {"scores": scored, "calibration": calibrated}


def score(watched: Watched) -> dict[str, Any]:
    """Frames, accuracy, log loss, AUC and Brier score; None where it is not defined."""
    found = scores(watched.log_odds, watched.not_yield)
    if found["brier"] is None:
        found["auc"] = auc(watched.margin, watched.not_yield)
    digits = {"accuracy_pct": 2, "log_loss": 4, "auc": 4, "brier": 4}
    kept = {name: None if found[name] is None else round(found[name], n) for name, n in digits.items()}
    return {"frames": found["n"], **kept}


def calibration(watched: Watched) -> list[dict[str, Any]]:
    """Mean P(NOT_YIELD) and share that did not yield, by bins of the former; none for a rule without probabilities."""
    if not np.isfinite(watched.log_odds).all():
        return []
    return [
        {"p_from": low, "p_to": high, "frames": n, "mean_p": round(mean, 4), "not_yield_share": round(share, 4)}
        for low, high, n, mean, share in filled_bins(watched.log_odds, watched.not_yield, PROBABILITY_BINS)
    ]


def density_losses(model: IntentionModel, held_out: Encounters) -> list[dict[str, Any]]:
    """Mean of `-log P(V_t | V_{t-1}, I)` [log(s/m)] of the three densities on held-out cars; less is better.

    The histogram's probability of a bin is spread evenly over it. Densities are as the estimators use them by default,
    and are compared on the transitions that the histogram does not rule out; the others are counted.

    Returns:
        One row per kind of speeds (`smoothed`, as the model was trained on, and `observed`, as an estimator sees
        them), intention and band of V_{t-1}, then one over all bands.
    """
    rows = []
    learned = model.speed(1)
    used = (
        learned.histogram.with_background(Pgm().epsilon),
        learned.gaussian.floored(PgmG().min_sigma),
        learned.mixture,
    )
    for speeds in ("smoothed", "observed"):
        before, now, label = transitions(held_out, 1, observed=speeds == "observed")
        losses = np.stack([-density.log_density(before, now) for density in used])
        bands = (np.maximum(before, 0.0) // SPEED_BAND).astype(np.int64)  # what is observed may lie just below 0
        for intention in (Intention.YIELD, Intention.NOT_YIELD):
            own = label == intention
            parts = {f"{i * SPEED_BAND:g}-{(i + 1) * SPEED_BAND:g}": own & (bands == i) for i in np.unique(bands[own])}
            rows += [
                {
                    "speeds": speeds,
                    "intention": intention.name,
                    "from_m_s": band,
                    **_mean_losses(losses[:, intention, here]),
                }
                for band, here in (parts | {"all": own}).items()
            ]
    return rows


def _mean_losses(losses: FloatArray) -> dict[str, Any]:
    possible = np.asarray(np.isfinite(losses).all(axis=0))
    means = losses[:, possible].mean(axis=1).round(4).tolist() if possible.any() else [None] * len(DENSITIES)
    ruled_out = int((~possible).sum())
    return {"transitions": len(possible), "ruled_out": ruled_out, **dict(zip(DENSITIES, means, strict=True))}

"""Training a model from a site's pairs, and judging it on merging cars it has never seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from merge_cosim.encounter import Encounters, Intention
from merge_cosim.errors import UserError
from merge_cosim.experiments.scenario import Pairs
from merge_cosim.experiments.sources import SourceChoice, pairs_of_site
from merge_cosim.intention.base import Estimator, estimators
from merge_cosim.intention.model import IntentionModel
from merge_cosim.intention.training import fit
from merge_cosim.ngsim.split import split_cars
from merge_cosim.observation import Observation, Setting
from merge_cosim.streams import stream_keys
from merge_cosim.units import DT, FloatArray

DISTANCES = ((0.0, 40.0), (40.0, 70.0), (70.0, 110.0), (110.0, np.inf))
"""Bands of the merging car's distance to the merging point [m], by which estimates are judged."""
JUDGED = ("pgm", "pgm-time", "pgm-speed", "slot-time")


def train(
    site: str, data: Path | None, source: SourceChoice | None, split: str, seed: int, out: Path
) -> dict[str, Any]:
    """Fit a model on one third of a site's pairs, write it, and judge it on the rest.

    Raises:
        UserError: There are no such pairs, or too few of one intention.
    """
    pairs = Pairs.model_validate({"kind": "pairs", "sites": {site: "train"}, "split": split, "seed": seed})
    encounters = pairs_of_site(site, pairs, data, source)
    chosen = split_cars(encounters, pairs.fraction, pairs.seed, pairs.split)
    train_part = encounters.take(np.flatnonzero(chosen))
    settings = {"split": split, "fraction": pairs.fraction, "seed": seed, "rules": vars(pairs.rules)}
    model = fit(train_part, out.stem, settings)
    if out.suffix != ".json":
        raise UserError(f"{out}: a model file ends in .json")
    out.parent.mkdir(parents=True, exist_ok=True)
    model.save(out)
    held_out = encounters.take(np.flatnonzero(~chosen))
    return {
        "model": str(out),
        "source": str(encounters.source[0]),
        "train_pairs": len(train_part),
        "train_cars": len(np.unique(train_part.car)),
        "test_pairs": len(held_out),
        "test_cars": len(np.unique(held_out.car)),
        "yield_share": round(float((train_part.label == Intention.YIELD).mean()), 4),
        "held_out": judge(model, held_out),
    }


def judge(model: IntentionModel, held_out: Encounters) -> list[dict[str, Any]]:
    """Accuracy and log loss per frame on held-out pairs, by estimator and distance of the merging car.

    Both cars drive as logged; frames count while neither has reached the merging point.
    """
    rows = []
    for name in JUDGED:
        estimator = estimators[name]()
        if estimator.needs_model:
            estimator.use(model)
        log_odds, distance, label = open_loop(estimator, held_out)
        for near, far in DISTANCES:
            here = (distance >= near) & (distance < far)
            if not here.any():
                continue
            odds, truth = log_odds[here], label[here] == Intention.NOT_YIELD
            signed = np.where(truth, odds, -odds)
            rows.append(
                {
                    "estimator": name,
                    "distance_m": f"{near:g}-{far:g}",
                    "frames": int(here.sum()),
                    "accuracy_pct": round(100 * float(((odds >= 0) == truth).mean()), 2),
                    "log_loss": round(float(np.logaddexp(0.0, -signed).mean()), 4) if np.isfinite(odds).all() else None,
                }
            )
    return rows


def open_loop(estimator: Estimator, encounters: Encounters, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Let an estimator watch the logs, without driving.

    Returns:
        Log-odds, the merging car's distance [m], and the label of every frame in which neither car has reached the
        merging point; each of shape (frames,).
    """
    log, n = encounters.log, len(encounters)
    assert log is not None
    estimator.start(n, Setting())
    estimator.reset(np.arange(n), encounters.label, stream_keys(encounters.case, seed))
    both = np.minimum(log.merging_station.lengths, log.host_station.lengths)
    parts = []
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
        odds = estimator.update(seen)
        use = (cycle < both - 1) & (seen.host_station < 0) & (seen.merging_station < 0)
        parts.append((odds[use], -seen.merging_station[use], encounters.label[use]))
    odds, distance, label = (np.concatenate(column) for column in zip(*parts, strict=True))
    return odds, distance, label

"""Training models from a site's pairs, and judging each on merging cars not trained on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import BoolArray
from merge_cosim.estimators.learned.fitting import fit
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.pairing.split import folds_of, split_cars
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.scenarios.encounters import SourceChoice, pairs_of_site
from merge_cosim.scenarios.sources import Pairs
from merge_cosim.studies.judging import density_losses, judge

Split = Literal["car", "pair"]
MOST_MODELS = 1_000
"""Most models of one training."""


def train(
    site: str,
    data: Path | None,
    source: SourceChoice | None,
    split: Split,
    seed: int,
    out: Path,
    everything: bool = False,
) -> dict[str, Any]:
    """Fit a model on one third of a site's pairs, write it, and judge it on the rest; see `merge_cosim.train`.

    Raises:
        UserError: There are no such pairs, or too few of one intention.
    """
    if out.suffix != ".json":
        raise UserError(f"{out}: a model file ends in .json")
    encounters, settings = _pairs(site, data, source, split, seed)
    if everything:
        chosen = np.ones(len(encounters), dtype=bool)
        settings |= {"fraction": 1.0}
    else:
        chosen = split_cars(encounters, settings["fraction"], seed, split)
    model, held_out = _fitted(encounters, chosen, out, settings)
    judged = judge(model, held_out) if len(held_out) else {"scores": [], "calibration": []}
    trained = encounters.take(np.flatnonzero(chosen))
    return {
        "model": str(out),
        "source": str(encounters.source[0]),
        "train_pairs": len(trained),
        "train_cars": len(np.unique(trained.car)),
        "test_pairs": len(held_out),
        "test_cars": len(np.unique(held_out.car)),
        "yield_share": round(float((trained.label == Intention.YIELD).mean()), 4),
        "held_out": judged["scores"],
        "calibration": judged["calibration"],
        "densities": density_losses(model, held_out) if len(held_out) else [],
    }


def train_ensemble(
    site: str,
    data: Path | None,
    source: SourceChoice | None,
    seed: int,
    out: Path,
    splits: int = 0,
    folds: int = 0,
) -> list[dict[str, Any]]:
    """Fit several models into a folder, as `merge_cosim.train_ensemble` says.

    Returns:
        One row per model: file, pairs and cars.

    Raises:
        UserError: See `train`; or neither or both numbers are given, or too many, or there are fewer cars than folds.
    """
    if (splits > 0) == (folds > 0):
        raise UserError("train: give --splits K or --folds K, not both")
    if max(splits, folds) > MOST_MODELS:
        raise UserError(
            f"train --{'splits' if splits else 'folds'} {max(splits, folds)}: no more than {MOST_MODELS} models, each "
            "of which takes about a second"
        )
    encounters, settings = _pairs(site, data, source, "car", seed)
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    for number, (chosen, how) in enumerate(_choices(encounters, settings["fraction"], seed, splits, folds)):
        file = out / f"{Path(site).name}-{encounters.source[0]}-{'split' if splits else 'fold'}-{number:02d}.json"
        _fitted(encounters, chosen, file, settings | how)
        trained = encounters.take(np.flatnonzero(chosen))
        rows.append({"model": str(file), "train_pairs": len(trained), "train_cars": len(np.unique(trained.car))})
    return rows


def _choices(
    encounters: Encounters, fraction: float, seed: int, splits: int, folds: int
) -> Iterator[tuple[BoolArray, dict[str, Any]]]:
    for number in range(splits):
        yield split_cars(encounters, fraction, seed + number), {"seed": seed + number}
    fold = folds_of(encounters, folds, seed) if folds else None
    for number in range(folds):
        yield np.asarray(fold != number), {"fold": number, "folds": folds, "fraction": round(1 - 1 / folds, 6)}


def _pairs(
    site: str, data: Path | None, source: SourceChoice | None, split: Split, seed: int
) -> tuple[Encounters, dict[str, Any]]:
    """All pairs of a site, and how they are chosen and split, for the model file."""
    pairs = Pairs.model_validate({"kind": "pairs", "sites": {site: "train"}, "split": split, "seed": seed})
    encounters = pairs_of_site(site, pairs, data, source)
    rules = pairs.rules.over(find_site(site).pairs)
    return encounters, {"split": split, "fraction": pairs.fraction, "seed": seed, "rules": vars(rules)}


def _fitted(
    encounters: Encounters, chosen: BoolArray, file: Path, settings: dict[str, Any]
) -> tuple[IntentionModel, Encounters]:
    """Fit and write a model; returns it and the pairs that it has not seen."""
    model = fit(encounters.take(np.flatnonzero(chosen)), file.stem, settings)
    file.parent.mkdir(parents=True, exist_ok=True)
    model.save(file)
    return model, encounters.take(np.flatnonzero(~chosen))

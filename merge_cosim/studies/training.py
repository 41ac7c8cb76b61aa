"""Training a model from a site's pairs, and judging it on merging cars not trained on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.fitting import fit
from merge_cosim.ngsim.pairing.split import split_cars
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.scenarios.encounters import SourceChoice, pairs_of_site
from merge_cosim.scenarios.sources import Pairs
from merge_cosim.studies.judging import density_losses, judge


def train(
    site: str, data: Path | None, source: SourceChoice | None, split: str, seed: int, out: Path
) -> dict[str, Any]:
    """Fit a model on one third of a site's pairs, write it, and judge it on the rest.

    Raises:
        UserError: There are no such pairs, or too few of one intention.
    """
    if out.suffix != ".json":
        raise UserError(f"{out}: a model file ends in .json")
    pairs = Pairs.model_validate({"kind": "pairs", "sites": {site: "train"}, "split": split, "seed": seed})
    encounters = pairs_of_site(site, pairs, data, source)
    chosen = split_cars(encounters, pairs.fraction, pairs.seed, pairs.split)
    train_part = encounters.take(np.flatnonzero(chosen))
    rules = pairs.rules.over(find_site(site).pairs)
    settings = {"split": split, "fraction": pairs.fraction, "seed": seed, "rules": vars(rules)}
    model = fit(train_part, out.stem, settings)
    out.parent.mkdir(parents=True, exist_ok=True)
    model.save(out)
    held_out = encounters.take(np.flatnonzero(~chosen))
    judged = judge(model, held_out)
    return {
        "model": str(out),
        "source": str(encounters.source[0]),
        "train_pairs": len(train_part),
        "train_cars": len(np.unique(train_part.car)),
        "test_pairs": len(held_out),
        "test_cars": len(np.unique(held_out.car)),
        "yield_share": round(float((train_part.label == Intention.YIELD).mean()), 4),
        "held_out": judged["scores"],
        "calibration": judged["calibration"],
        "densities": density_losses(model, held_out),
    }

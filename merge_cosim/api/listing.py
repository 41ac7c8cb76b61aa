"""What there is: methods, scenarios, models and ramps, as tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from merge_cosim.estimators.learned.model import MODELS, IntentionModel
from merge_cosim.ramps.ramp import Ramp, ramp_names
from merge_cosim.scenarios.catalogue import components
from merge_cosim.scenarios.scenario import load_scenario, scenario_names


def list_methods(plugins: Sequence[str | Path] = ()) -> pd.DataFrame:
    """Estimators, controllers, merging cars and sensors: role, name, what it is, parameters with their defaults.

    Args:
        plugins: Python files with components of your own.
    """
    return pd.DataFrame(components([Path(plugin) for plugin in plugins]))


def list_scenarios() -> pd.DataFrame:
    """The shipped scenarios: name, title, ramp, what the test is."""
    every = [load_scenario(name) for name in scenario_names()]
    return pd.DataFrame(
        [
            {"scenario": one.name, "title": one.title, "ramp": one.ramp, "about": " ".join(one.about.split())}
            for one in every
        ]
    )


def list_models() -> pd.DataFrame:
    """The learned models that come with the project: name, site, source and numbers of training pairs and cars."""
    every = [IntentionModel.load(file.stem) for file in sorted(MODELS.glob("*.json"))]
    return pd.DataFrame(
        [
            {
                "model": one.name,
                "site": one.site,
                "source": one.source,
                "train_pairs": int(one.pairs.sum()),
                "train_cars": len(one.trained_on),
            }
            for one in every
        ]
    )


def list_ramps() -> pd.DataFrame:
    """The shipped ramps: name, title, net, and their measures in metres past the gore."""
    return pd.DataFrame([Ramp.load(name).summary() for name in ramp_names()])

"""Splitting encounters into those to train on and those to test on, so that the same merge is never on both sides."""

from hashlib import sha256
from typing import Literal

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.units import BoolArray


def split_cars(
    encounters: Encounters, fraction: float = 1 / 3, seed: int = 0, by: Literal["car", "pair"] = "car"
) -> BoolArray:
    """Choose the encounters to train on.

    The choice depends on the names and the seed only, not on the order of the encounters. Cars are drawn by a hash of
    their names, so that one car more or less (under other pairing rules, say) moves at most one of the others.

    Args:
        encounters: Logged encounters of one site.
        fraction: Share of merging cars (or pairs) to train on.
        seed: Seed of the choice.
        by: `car` keeps all pairs of a merging car on one side; `pair` splits them, as the papers did.

    Returns:
        True where an encounter is for training, shape (n,).
    """
    names = np.asarray(encounters.car if by == "car" else encounters.case, dtype=str)
    drawn = sorted(set(names), key=lambda name: sha256(f"{seed}|{name}".encode()).digest())
    return np.isin(names, drawn[: round(fraction * len(drawn))])

"""Splitting encounters into those to train on and those to test on, so that the same merge is never on both sides."""

from hashlib import sha256
from typing import Literal

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import AnyArray, BoolArray, IntArray


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
    drawn = _shuffled(names, seed)
    return np.isin(names, drawn[: round(fraction * len(drawn))])


def folds_of(encounters: Encounters, folds: int, seed: int = 0) -> IntArray:
    """Deal the merging cars of some encounters into parts of equal size, all pairs of a car into one.

    Returns:
        Number of each encounter's part, shape (n,).

    Raises:
        UserError: There are fewer than two parts, or fewer cars than parts.
    """
    names = np.asarray(encounters.car, dtype=str)
    drawn = _shuffled(names, seed)
    if not 2 <= folds <= len(drawn):
        raise UserError(f"train: {folds} folds of {len(drawn)} merging cars; choose 2 to {len(drawn)}")
    part = {name: number % folds for number, name in enumerate(drawn)}
    return np.array([part[name] for name in names])


def _shuffled(names: AnyArray, seed: int) -> list[str]:
    """Different names in an order that depends only on each name's hash and the seed."""
    return sorted(set(names.tolist()), key=lambda name: sha256(f"{seed}|{name}".encode()).digest())

"""Encounters for the tests of the loop."""

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.merging_cars.designed import Designed


def random_encounters(count: int, seed: int, merge_position: float = 0.0) -> Encounters:
    """Random initial states, partly on whole numbers, where ties lie."""
    rng = np.random.default_rng(seed)
    whole = rng.random(count) < 0.5

    def draw(low: float, high: float) -> np.ndarray:
        values = rng.uniform(low, high, count)
        return np.where(whole, np.round(values), values)

    return Encounters(
        case=np.array([f"r{i}" for i in range(count)]),
        site=np.full(count, "designed"),
        source=np.full(count, "designed"),
        car=np.full(count, ""),
        host_station=draw(-120, -40),
        host_speed=draw(0, 30),
        host_length=draw(4, 12),
        merging_station=draw(-120, -40),
        merging_speed=draw(0, 30),
        merging_length=draw(4, 12),
        merge_position=np.full(count, merge_position),
        label=np.full(count, -1),
        smoothed_source=np.zeros(count, dtype=bool),
        length_missing=np.zeros(count, dtype=bool),
    )


class Same(Designed):
    """Keeps the merging car's speed."""

    name = "same"

    def next_speed(self, age, now):
        return now.merging_speed

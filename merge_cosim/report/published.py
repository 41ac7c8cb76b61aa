"""The papers' published figures, shown beside ours; nothing is tuned to them."""

from __future__ import annotations

from dataclasses import dataclass

PGM_PAPER = "Dong, Dolan, Litkouhi 2017 (PGM), Table II"
FG_GMM_PAPER = "Lyu, Dong, Dolan 2020 (FG-GMM), Table III"


@dataclass(frozen=True)
class Figure:
    """One cell pair of a published table.

    Attributes:
        failure_pct: Failure rate [%].
        distance_m: Mean distance to the merging car when the host reaches the merging point [m]; None if not given.
    """

    failure_pct: float
    distance_m: float | None = None


PUBLISHED: dict[str, dict[str, Figure]] = {
    "us101-replay": {
        "acc": Figure(17.6, 22.2),
        "slot": Figure(14.8, 22.8),
        "ipcb": Figure(19.3, 23.7),
        "pgm-g": Figure(20.1, 24.3),
        "pgm": Figure(8.7, 25.8),
        "fg-gmm": Figure(7.3, 23.3),
    },
    "i80-replay": {
        "acc": Figure(16.5, 7.0),
        "slot": Figure(10.4, 10.3),
        "ipcb": Figure(15.8, 13.7),
        "pgm-g": Figure(11.3, 14.6),
        "pgm": Figure(7.6, 16.4),
        "fg-gmm": Figure(7.0, 14.7),
    },
    "designed-1": {
        "acc": Figure(13.3),
        "slot": Figure(2.4),
        "ipcb": Figure(0.9),
        "pgm-g": Figure(0.9),
        "pgm": Figure(0.4),
    },
    "designed-2": {
        "acc": Figure(6.8),
        "slot": Figure(4.2),
        "ipcb": Figure(1.2),
        "pgm-g": Figure(1.8),
        "pgm": Figure(0.2),
    },
}
"""By scenario and method, of `PGM_PAPER`; fg-gmm of `FG_GMM_PAPER`. Designed Test I is published over both sites
together."""

CYCLE_MS = {"acc": 0.05, "ipcb": 0.20, "pgm-g": 0.51, "pgm": 0.08, "fg-gmm": 0.08}
"""Published mean time per cycle [ms]."""

VALIDITY = {
    "us101-replay": {"pgm-g": 20.0, "fg": 13.0, "fg-gmm": 6.0},
    "i80-replay": {"pgm-g": 23.0, "fg": 14.0, "fg-gmm": 7.0},
}
"""Published failure rates [%] of the validity test, 100 pairs each (Lyu, Dong, Dolan 2020, Table II): US-101
07:50-08:05, I-80 05:15-05:30 pm."""


@dataclass(frozen=True)
class Component:
    """One component of the published mixture over (V_{t-1}, V_t), in feet as printed.

    The table prints one row of each covariance matrix, so the variance of V_t is not known and no conditional density
    can be rebuilt.

    Attributes:
        weight: Its weight.
        mean_before, mean_now: Its mean [ft/s].
        variance: Variance of V_{t-1} [ft^2/s^2].
        covariance: Covariance of both speeds [ft^2/s^2].
    """

    weight: float
    mean_before: float
    mean_now: float
    variance: float
    covariance: float


PUBLISHED_MIXTURES: dict[str, tuple[Component, Component]] = {
    "YIELD": (Component(0.57, 17.59, 17.58, 64.04, 64.00), Component(0.42, 43.51, 43.50, 106.53, 106.77)),
    "NOT_YIELD": (Component(0.56, 17.87, 17.87, 66.25, 66.20), Component(0.43, 44.02, 44.01, 106.96, 107.20)),
}
"""By intention, slower component first (the paper prints NOT_YIELD's the other way round): Lyu, Dong, Dolan 2020
(FG-GMM), Table I."""


def published(scenario: str, method: str) -> Figure | None:
    """Return what the papers give for a method in a scenario, if anything."""
    return PUBLISHED.get(scenario, {}).get(method)

"""Compare the surrogate with real NGSIM data and write docs/surrogate.md with its pictures."""

import argparse
from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import ks_2samp

from merge_cosim.encounter import Encounters, Intention
from merge_cosim.ngsim.encounters import site_encounters
from merge_cosim.ngsim.sites import SITES, Site
from merge_cosim.traffic.surrogate import surrogate_folder
from merge_cosim.units import DT, FloatArray, time_to_arrival

ROOT = Path(__file__).parent.parent
BANDS = ((0, 40), (40, 70), (70, 110), (110, 500))


def log_of(e: Encounters):
    assert e.log is not None
    return e.log


def tracks(e: Encounters, which: str) -> list[FloatArray]:
    """Stations [m] of one car of each pair from the window's start to the lane change."""
    log = log_of(e)
    track = log.merging_station if which == "merging" else log.host_station
    return [track[i][: int(log.change_cycle[i]) + 1] for i in range(len(e))]


def once(e: Encounters) -> np.ndarray:
    return np.unique(e.car, return_index=True)[1]


def speeds(which: str) -> Callable[[Encounters], FloatArray]:
    return lambda e: np.concatenate([np.diff(s) / DT for s in tracks(e, which)])


def accelerations(which: str) -> Callable[[Encounters], FloatArray]:
    return lambda e: np.concatenate([np.diff(s, n=2) / DT**2 for s in tracks(e, which)])


def arrivals(e: Encounters) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """T_m, T_h [s], distance of the merging car [m] and label in every frame with both before the merge."""
    rows = []
    for m, h, label in zip(tracks(e, "merging"), tracks(e, "host"), e.label, strict=True):
        both = (m[1:] < 0) & (h[1:] < 0)
        t_m, t_h = (time_to_arrival(s[1:], np.diff(s) / DT)[both] for s in (m, h))
        rows.append((t_m, t_h, -m[1:][both], np.full(both.sum(), label)))
    return tuple(np.concatenate(column) for column in zip(*rows, strict=True))


def at_change(label: Intention) -> Callable[[Encounters], FloatArray]:
    return lambda e: np.abs([s[-1] for s in tracks(e, "host")])[e.label == label]


MEASURES: dict[str, Callable[[Encounters], FloatArray]] = {
    "host speed [m/s]": speeds("host"),
    "merging car's speed [m/s]": speeds("merging"),
    "host acceleration [m/s²]": accelerations("host"),
    "merging car's acceleration [m/s²]": accelerations("merging"),
    "time to arrival T_m [s]": lambda e: arrivals(e)[0],
    "time to arrival T_h [s]": lambda e: arrivals(e)[1],
    "T_m − T_h [s]": lambda e: np.subtract(*arrivals(e)[:2]),
    "lane change, past the gore [m]": lambda e: e.merge_position[once(e)],
    "speed at the lane change [m/s]": lambda e: np.array([s[-1] - s[-2] for s in tracks(e, "merging")])[once(e)] / DT,
    "merging distance in the window [m]": lambda e: -e.merging_station,
    "to the car ahead at the change [m]": at_change(Intention.YIELD),
    "to the car behind at the change [m]": at_change(Intention.NOT_YIELD),
}

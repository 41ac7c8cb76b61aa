"""Learning an intention model from logged encounters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from merge_cosim.encounter import Encounters, Intention
from merge_cosim.errors import UserError
from merge_cosim.intention.model import SPEED_BINS, TIME_BIN, TIME_BINS, IntentionModel, speed_bin, time_bin
from merge_cosim.units import DT, FloatArray, time_to_arrival

LAGS = (1, 5, 10)
"""Lags [cycles] for which speed transitions are counted."""


def fit(encounters: Encounters, name: str, settings: Mapping[str, Any]) -> IntentionModel:
    """Count speed transitions, times to arrival and intentions (Dong, Dolan, Litkouhi 2017, Sec. IV).

    Speeds are differences of the smoothed stations, from the window's start to the lane change. Times to arrival are
    counted while neither car has reached the merging point; each pair has the same weight, however long it lasts.

    Raises:
        UserError: The encounters have no logs, or lack one of the two intentions.
    """
    log = encounters.log
    if log is None:
        raise UserError(f"model {name}: training needs logged encounters")
    pairs = np.array([(encounters.label == i).sum() for i in (Intention.YIELD, Intention.NOT_YIELD)])
    if not pairs.all():
        raise UserError(f"model {name}: {pairs[0]} yielding and {pairs[1]} not yielding pairs; both are needed")
    transitions = {lag: np.zeros((2, SPEED_BINS, SPEED_BINS), dtype=np.int64) for lag in LAGS}
    arrivals = np.zeros((2, TIME_BINS, TIME_BINS))
    merge_speeds = {}
    for row in range(len(encounters)):
        label = encounters.label[row]
        last = int(log.change_cycle[row])
        merging, host = log.merging_station[row], log.host_station[row][: last + 1]
        speed = _speeds(merging)[: last + 1]
        bins = speed_bin(speed)
        merge_speeds[str(encounters.car[row])] = float(speed[-1])
        for lag, counts in transitions.items():
            np.add.at(counts[label], (bins[:-lag], bins[lag:]), 1)
        merging = merging[: len(host)]
        t_m = time_to_arrival(merging, speed[: len(host)])
        t_h = time_to_arrival(host, _speeds(host))
        use = (merging < 0) & (host < 0) & (np.maximum(t_m, t_h) < TIME_BINS * TIME_BIN)
        if use.any():
            np.add.at(arrivals[label], (time_bin(t_m[use]), time_bin(t_h[use])), 1.0 / use.sum())
    return IntentionModel(
        name=name,
        site=str(encounters.site[0]),
        source=str(encounters.source[0]),
        trained_on=tuple(sorted({str(car) for car in encounters.car})),
        settings=dict(settings),
        pairs=pairs,
        merge_speed=round(float(np.mean(list(merge_speeds.values()))), 6),
        transitions=transitions,
        arrivals=arrivals,
    )


def _speeds(station: FloatArray) -> FloatArray:
    step = np.diff(station) / DT
    return np.maximum(np.concatenate([step[:1], step]), 0.0)

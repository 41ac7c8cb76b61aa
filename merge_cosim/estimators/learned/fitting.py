"""Learning an intention model from logged encounters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT, FloatArray, IntArray, time_to_arrival
from merge_cosim.estimators.learned.histogram import TIME_BINS, ArrivalHistogram, time_bin
from merge_cosim.estimators.learned.model import IntentionModel, SpeedModel

LAGS = (1, 5, 10)
"""Lags [cycles] for which speed transitions are learned."""


def fit(encounters: Encounters, name: str, settings: Mapping[str, Any]) -> IntentionModel:
    """Learn speed transitions, times to arrival and the prior (Dong, Dolan, Litkouhi 2017, Sec. IV).

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
    arrivals = np.zeros((2, TIME_BINS, TIME_BINS))
    merge_speeds = {}
    for row in range(len(encounters)):
        label = encounters.label[row]
        last = int(log.change_cycle[row])
        merging, host = log.merging_station[row], log.host_station[row][: last + 1]
        speed = _speeds(merging)[: last + 1]
        merge_speeds[str(encounters.car[row])] = float(speed[-1])
        merging = merging[: len(host)]
        t_m = time_to_arrival(merging, speed[: len(host)])
        t_h = time_to_arrival(host, _speeds(host))
        use = (merging < 0) & (host < 0)
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
        speeds={lag: SpeedModel.fit(*transitions(encounters, lag)) for lag in LAGS},
        arrivals=ArrivalHistogram(arrivals),
    )


def transitions(encounters: Encounters, lag: int, observed: bool = False) -> tuple[FloatArray, FloatArray, IntArray]:
    """Gather the merging cars' speeds `lag` cycles apart, from the window's start to the lane change.

    Args:
        encounters: Logged encounters; a car of several pairs counts once in each.
        lag: Cycles between the two speeds.
        observed: Take the speeds that an estimator observes instead of differences of smoothed stations.

    Returns:
        Speeds before and now [m/s] and the pair's label, each of shape (transitions,).
    """
    log = encounters.log
    assert log is not None
    before, now, label = [], [], []
    for row in range(len(encounters)):
        speed = log.merging_speed[row] if observed else _speeds(log.merging_station[row])
        speed = speed[1 : int(log.change_cycle[row]) + 1]  # the first of the differences stands there twice
        before.append(speed[:-lag])
        now.append(speed[lag:])
        label.append(np.full(len(before[-1]), encounters.label[row]))
    return np.concatenate(before), np.concatenate(now), np.concatenate(label)


def _speeds(station: FloatArray) -> FloatArray:
    step = np.diff(station) / DT
    return np.maximum(np.concatenate([step[:1], step]), 0.0)

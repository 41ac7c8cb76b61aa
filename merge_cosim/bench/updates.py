"""What an update of each registered estimator costs, alone and in a full batch."""

from __future__ import annotations

from statistics import median
from time import process_time
from typing import Any

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.core.units import DT
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.sweeps.plan import default_model
from merge_cosim.sweeps.worker_session import TILES

CYCLES = 60
"""Cycles of each timed run: six seconds of an approach."""


def estimator_costs(rounds: int) -> list[dict[str, Any]]:
    """Processor time of an update per encounter [us], median over `rounds` rounds; the estimators take turns."""
    model = IntentionModel.load(default_model("ngsim"))
    names = estimators.names()
    times: dict[tuple[str, int], list[float]] = {(name, count): [] for name in names for count in (TILES, 1)}
    for _ in range(rounds):
        for (name, count), found in times.items():
            found.append(_update_us(_ready(name, model, count), count))
    return [
        {
            "estimator": name,
            "full_batch_us": round(median(times[name, TILES]), 3),
            "alone_us": round(median(times[name, 1]), 2),
        }
        for name in names
    ]


def _ready(name: str, model: IntentionModel, count: int) -> Estimator:
    estimator = estimators[name]()
    if estimator.needs_model:
        estimator.use(model)
    estimator.start(count, Setting())
    keys = stream_keys(np.arange(count).astype(str), seed=0)
    estimator.reset(np.arange(count), np.full(count, int(Intention.YIELD)), keys)
    return estimator


def _update_us(estimator: Estimator, count: int) -> float:
    """Both cars approach with speeds that change a little from cycle to cycle."""
    rng = np.random.default_rng(0)
    speeds = rng.uniform(8.0, 20.0, (2, count)) + np.cumsum(rng.normal(0.0, 0.05, (CYCLES, 2, count)), axis=0)
    stations = -120.0 + np.cumsum(speeds * DT, axis=0)
    length = np.full(count, 5.0)
    seen = [
        Observation(station[0], speed[0], station[1], speed[1], length, length)
        for station, speed in zip(stations, speeds, strict=True)
    ]
    begin = process_time()
    for one in seen:
        estimator.update(one)
    return 1e6 * (process_time() - begin) / (CYCLES * count)

"""The row `human`: the logged host itself, scored as the methods are. He is a row made from the log, no estimator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.merging_cars.base import MergingCar
from merge_cosim.merging_cars.replay import Replay
from merge_cosim.scoring.scoring import Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Effort, Run, simulate
from merge_cosim.simulation.worlds.tiles import ClosedFormWorld


def simulate_human(
    encounters: Encounters, merging_car: MergingCar, rules: Rules, setting: Setting, traced: tuple[int, ...] = ()
) -> Run:
    """Let the logged hosts meet the logged merging cars, in the closed form, and score them by the same rules.

    A host whose log ends before scoring does goes on at its last speed. Nothing is decided, and no effort is counted,
    since neither SUMO nor a method is at work.

    Args:
        encounters: The n cases, with a log.
        merging_car: How the merging cars drive.
        rules: When a case is scored.
        setting: Speed limit and cycle.
        traced: Indices of the cases to record cycle by cycle.
    """
    world = _LoggedHostWorld(encounters, setting)
    run = simulate(world, encounters, _Nobody(), merging_car, rules, setting, traced)
    undecided = run.columns | {"last_decision": np.full(len(encounters), -1.0)}
    return replace(run, columns=undecided, effort=Effort())


class _LoggedHostWorld(ClosedFormWorld):
    """The closed form with hosts that meet their logged stations, whatever they are told."""

    def __init__(self, encounters: Encounters, setting: Setting) -> None:
        n = len(encounters)
        super().__init__(n)
        assert encounters.log is not None
        as_merging = replace(encounters.log, merging_station=encounters.log.host_station)
        self._driver = Replay()
        self._driver.start(replace(encounters, log=as_merging), n, setting)
        self._age = np.zeros(n, dtype=np.int64)

    def place(self, tiles: IntArray, encounters: Encounters, cases: IntArray) -> None:
        super().place(tiles, encounters, cases)
        self._driver.reset(tiles, cases)
        self._age[tiles] = 0

    def advance(self, speeds: FloatArray) -> None:
        super().advance(np.array([self._driver.speed(self._age), speeds[1]]))
        self._age += 1


class _Nobody(HostDriver):
    """Believes and commands nothing."""

    def __init__(self) -> None: ...

    def start(self, count: int, setting: Setting) -> None: ...

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None: ...

    def decide(self, seen: Observation) -> tuple[FloatArray, FloatArray]:
        return np.full_like(seen.host_station, np.nan), np.zeros_like(seen.host_station)

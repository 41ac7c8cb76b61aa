"""The recorded host itself in the closed form, which makes the row `human`. It is not an estimator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.references import AlwaysGo
from merge_cosim.merging_cars.replay import Replay
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.leader import LeaderRule
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld


class LoggedHostWorld(ClosedFormWorld):
    """The closed form with hosts that drive as they were logged, whatever is commanded.

    A host whose log ends before scoring does goes on at its last speed.
    """

    commanded = False

    def start(
        self, encounters: Encounters | None, setting: Setting, rules: Rules, leader: LeaderRule, seed: int
    ) -> None:
        """See `World`."""
        super().start(encounters, setting, rules, leader, seed)
        log = self.encounters.log
        assert log is not None
        self._replay = Replay()
        as_merging = replace(log, merging_station=log.host_station)
        self._replay.start(replace(self.encounters, log=as_merging), self.slots, setting)
        self._age = np.zeros(self.slots, dtype=np.int64)

    def place(self, slots: IntArray, cases: IntArray) -> FloatArray:
        """See `GivenWorld`."""
        self._replay.reset(slots, cases)
        self._age[slots] = 0
        return super().place(slots, cases)

    def command(self, speeds: FloatArray) -> None:
        """See `World`; the hosts' speeds are the log's."""
        super().command(np.array([self._replay.speed(self._age), speeds[1]]))
        self._age += 1


class Undecided(HostDriver):
    """A method without belief (NaN) and without commands, for a world whose hosts need none."""

    def __init__(self) -> None:
        super().__init__(AlwaysGo(), Acc())

    def decide(self, seen: Observation, around: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """See `HostDriver`."""
        return np.full_like(seen.host_station, np.nan), np.zeros_like(seen.host_station)

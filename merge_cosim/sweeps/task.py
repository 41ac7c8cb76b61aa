"""One batch of a sweep, as a worker process runs it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import pyarrow as pa

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.rows import result_rows
from merge_cosim.results.schema import CLOSED_FORM, SUMO
from merge_cosim.scenarios.methods import Method
from merge_cosim.scenarios.scenario import Scenario
from merge_cosim.scoring.scoring import expected_cycles
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Effort, Run, simulate
from merge_cosim.simulation.worlds.logged import LoggedWorld
from merge_cosim.simulation.worlds.tiles import TiledWorld, World
from merge_cosim.sweeps.human import simulate_human

TILES = 192
"""Encounters side by side in one SUMO. From 128 to 208 tiles a case costs the same: more of them spread the cost of a
cycle's Python over more cars, but SUMO's own step costs more per car, as more cars fit its cache less well."""

CHUNK_CASES = 1_000
"""Most encounters that are handed out at a time: enough to keep the tiles busy, few enough to lose little when
interrupted."""


@dataclass(frozen=True, kw_only=True)
class Task(ABC):
    """Something of one scenario that is run under one method: `len` cases, which can be parted.

    Attributes:
        scenario: The scenario, variation applied.
        variation: What was varied, such as `acc.headway=1.0`; empty for the scenario as it is.
        method: The method.
        model: Its learned model, if it needs one.
        seed: SUMO's seed.
        left_out: Names of cases of the scenario that do not fit on its ramp.
        most: Most cases that are handed out at a time.
    """

    scenario: Scenario
    variation: str = ""
    method: Method
    model: IntentionModel | None = None
    seed: int = 0
    left_out: tuple[str, ...] = ()
    most: int

    @abstractmethod
    def __len__(self) -> int:
        """How many cases."""

    @abstractmethod
    def case(self, number: int) -> str:
        """Name of a case."""

    @abstractmethod
    def part(self, first: int, last: int) -> Self:
        """The cases `first` to `last - 1` as a task of their own."""

    @abstractmethod
    def cycles(self) -> FloatArray:
        """Expected cycles of each case, shape (len(self),)."""

    @abstractmethod
    def digest(self) -> str:
        """A short hash of what its cases hold."""

    @abstractmethod
    def run(self, worker_session: WorkerSession) -> tuple[pa.Table, Effort]:
        """Simulate the cases and return their result rows and what they cost."""

    @property
    def names(self) -> dict[str, str]:
        """What all rows of the batch have in common."""
        return {
            "scenario": self.scenario.name,
            "variation": self.variation,
            "method": self.method.name,
            "model": self.model.name if self.model else "",
        }

    def setting(self, ramp: Ramp) -> Setting:
        """Speed limit and cycle."""
        return Setting(speed_limit=self.scenario.speed_limit or ramp.speed_limit)


@dataclass(frozen=True, kw_only=True)
class Batch(Task):
    """Some encounters of one scenario under one method.

    Attributes:
        encounters: The cases.
    """

    encounters: Encounters
    most: int = CHUNK_CASES

    def __len__(self) -> int:
        return len(self.encounters)

    def case(self, number: int) -> str:
        """Name of a case."""
        return str(self.encounters.case[number])

    def part(self, first: int, last: int) -> Self:
        """The cases `first` to `last - 1`, made only when asked for, so that a million cases are not held twice."""
        return replace(self, encounters=self.encounters.part(first, last), left_out=())

    def take(self, rows: IntArray) -> Self:
        """The chosen cases, in that order."""
        return replace(self, encounters=self.encounters.take(rows))

    def cycles(self) -> FloatArray:
        """Expected cycles of each case; see `expected_cycles`."""
        return expected_cycles(self.encounters, self.scenario.test)

    def digest(self) -> str:
        """A short hash of the encounters."""
        return self.encounters.digest

    def run(self, worker_session: WorkerSession) -> tuple[pa.Table, Effort]:
        """Simulate the cases on tiles."""
        ramp = Ramp.load(self.scenario.ramp)
        run = self.simulate(self.world(worker_session, ramp), ramp)
        return self.rows(run, ramp), run.effort

    def world(self, worker_session: WorkerSession, ramp: Ramp) -> World:
        """What moves the cars."""
        return worker_session.world(ramp, len(self), self.seed)

    def driver(self, world: World) -> HostDriver:
        """The method, as it drives in a world."""
        return self.method.driver(self.model)

    def simulate(self, world: World, ramp: Ramp, traced: Sequence[int] = ()) -> Run:
        """Simulate the cases on a given world; the human host needs none."""
        rules, setting, car = self.scenario.test, self.setting(ramp), self.scenario.merging_car()
        if self.method.is_human:
            return simulate_human(self.encounters, car, rules, setting, tuple(traced))
        driver = self.driver(world)
        return self.finished(world, simulate(world, self.encounters, driver, car, rules, setting, traced, self.seed))

    def finished(self, world: World, run: Run) -> Run:
        """The run with what the world alone knows of it."""
        return run

    def rows(self, run: Run, ramp: Ramp) -> pa.Table:
        """The result rows of a run."""
        world = CLOSED_FORM if self.method.is_human else SUMO
        return result_rows(run, self.encounters, self.setting(ramp), self.scenario.test.free, self.names, world=world)


class WorkerSession:
    """Keeps one SUMO open from batch to batch, as long as ramp and seed stay the same."""

    def __init__(self, tiles: int = TILES) -> None:
        self._tiles = tiles
        self._open: tuple[str, int, int] | None = None
        self._world: TiledWorld | LoggedWorld | None = None

    def world(self, ramp: Ramp, cases: int, seed: int) -> TiledWorld:
        """A world on this ramp, with no more tiles than there are cases."""
        tiles = min(self._tiles, cases)
        wanted = (str(ramp.net), tiles, seed)
        if not isinstance(self._world, TiledWorld) or self._open != wanted:
            self.close()
            self._world, self._open = TiledWorld(ramp, tiles, seed), wanted
        return self._world

    def hold(self, world: LoggedWorld) -> LoggedWorld:
        """End the simulation that is open, and keep another world in its place."""
        self.close()
        self._world = world
        return world

    def close(self) -> None:
        """End the simulation."""
        if self._world is not None:
            self._world.close()
            self._world = None

"""A task of a sweep: cases of one scenario under one method, as a worker process runs them."""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import pandas as pd
import pyarrow as pa

from merge_cosim.core.observation import Setting
from merge_cosim.core.registry import plugin_error
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.invariants import checked, joined
from merge_cosim.results.parts import with_facts
from merge_cosim.results.rows import result_rows
from merge_cosim.scenarios.methods import Method
from merge_cosim.scenarios.scenario import Scenario
from merge_cosim.simulation.loop import Effort, Loop, Run
from merge_cosim.simulation.worlds.base import World
from merge_cosim.simulation.worlds.logged_host import Undecided
from merge_cosim.sweeps.cases import AS_IN_A_SWEEP, Cases, Facts, RunOptions
from merge_cosim.sweeps.worker_session import WorkerSession


@dataclass(frozen=True, kw_only=True)
class Task:
    """Cases of one scenario that are run under one method.

    Attributes:
        scenario: The scenario, variation applied.
        cases: What is run.
        variation: What was varied, such as `acc.headway=1.0`; empty for the scenario as it is.
        method: The method.
        model: Its learned model, if it needs one.
        seed: SUMO's seed.
        left_out: Names of cases of the scenario that do not fit on its ramp.
        recorded: Names of encounters to record; with any, `run` returns their records in place of result rows.
    """

    scenario: Scenario
    cases: Cases
    variation: str = ""
    method: Method
    model: IntentionModel | None = None
    seed: int = 0
    left_out: tuple[str, ...] = ()
    recorded: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self.cases)

    @property
    def most(self) -> int:
        """Most cases in a chunk."""
        return self.cases.most

    @property
    def names(self) -> dict[str, str]:
        """Values of the columns that are the same in all rows."""
        return {
            "scenario": self.scenario.name,
            "variation": self.variation,
            "method": self.method.name,
            "model": self.model.name if self.model else "",
        }

    @property
    def setting(self) -> Setting:
        """Speed limit and cycle."""
        return Setting(speed_limit=self.scenario.speed_limit or self.ramp.speed_limit)

    @property
    def ramp(self) -> Ramp:
        """The ramp."""
        return Ramp.load(self.scenario.ramp)

    def case(self, number: int) -> str:
        """Name of a case."""
        return self.cases.name(number)

    def cycles(self) -> FloatArray:
        """Expected cycles of each case, shape (len(self),)."""
        return self.cases.cycles(self.scenario.test)

    def digest(self) -> str:
        """A short hash of what its cases hold."""
        return self.cases.digest(self.ramp)

    def part(self, first: int, last: int) -> Self:
        """The cases `first` to `last - 1`, as a task of their own."""
        return replace(self, cases=self.cases.part(first, last), left_out=())

    def take(self, rows: IntArray) -> Self:
        """The chosen cases, in that order."""
        return replace(self, cases=self.cases.take(rows))

    def run(self, worker_session: WorkerSession) -> tuple[pa.Table, Effort]:
        """Simulate the cases; returns their result rows, or the records of the `recorded` ones, and what they cost.

        Raises:
            UserError: A component of a plugin has raised something.
        """
        effort, tables, facts, found_broken = Effort(), [], [], []
        try:
            for run, found in self.runs(worker_session, traced=self.recorded or ()):
                effort.add(run.effort)
                rows = self._records(run) if self.recorded else self.rows(run)
                tables.append(rows)
                if not self.recorded:
                    found_broken.append(checked(run, rows))
                facts += [{**self.names, **fact} for fact in found]
        except Exception as error:
            if line := plugin_error(error):
                raise line from error
            raise
        if self.recorded:
            return pa.concat_tables(tables), effort
        return with_facts(pa.concat_tables(tables), facts, joined(found_broken)), effort

    def runs(
        self, worker_session: WorkerSession, options: RunOptions = AS_IN_A_SWEEP, traced: Container[str] = ()
    ) -> Iterator[tuple[Run, Facts]]:
        """Simulate the cases, in as many runs as they need; facts of scenes beside each."""
        worlds = self.cases.worlds(self.ramp, self.seed, worker_session, options, self.method.is_human)
        for opening in worlds:
            with opening as (world, seed, facts):
                run = self.simulate(world, seed, traced)
                found = facts(run)
            yield run, found

    def simulate(self, world: World, seed: int = 0, traced: Container[str] = ()) -> Run:
        """Simulate the cases in a world, with the given seed of the encounters' random streams."""
        scenario = self.scenario
        driver = Undecided() if self.method.is_human else self.method.driver(self.model, scenario.sensor())
        run = Loop(
            world,
            self.cases.encounters,
            driver,
            scenario.merging_car(),
            scenario.test,
            self.setting,
            traced,
            seed,
        ).run()
        # The row `human` is made from the log, without SUMO and without a method.
        return replace(run, effort=Effort()) if self.method.is_human else run

    def _records(self, run: Run) -> pa.Table:
        """The records of a run, one row per cycle."""
        names = [name for name in map(str, run.encounters.case) if name in run.traces]
        records = [run.traces[name] for name in names]
        table = pa.Table.from_pandas(pd.concat([pd.DataFrame(), *records]), preserve_index=False)
        own = {
            "scenario": pa.repeat(pa.scalar(self.scenario.name, pa.large_string()), len(table)),
            "case": pa.array(np.repeat(np.array(names, dtype=object), [*map(len, records)]), pa.large_string()),
            "method": pa.repeat(pa.scalar(self.method.name, pa.large_string()), len(table)),
        }
        return pa.table({**own, **{name: table[name] for name in table.column_names}})

    def rows(self, run: Run) -> pa.Table:
        """The result rows of a run."""
        return result_rows(run, run.encounters, self.setting, self.scenario.test.free, self.names, self.model)

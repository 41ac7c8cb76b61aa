"""One batch of a sweep, as a worker process runs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pyarrow as pa

from merge_cosim.control.acc import Acc
from merge_cosim.control.base import controllers
from merge_cosim.cosim.loop import Effort, Run, simulate
from merge_cosim.cosim.plant import Plant, SumoPlant
from merge_cosim.encounter import Encounters
from merge_cosim.experiments.human import simulate_human
from merge_cosim.experiments.methods import Method
from merge_cosim.experiments.outcome import result_rows
from merge_cosim.experiments.scenario import Scenario
from merge_cosim.intention.model import IntentionModel
from merge_cosim.observation import Setting
from merge_cosim.ramps.ramp import Ramp

TILES = 160
"""Encounters side by side in one SUMO. Fewer spread the cost of a cycle's Python over fewer cars; with more than about
190 SUMO's own step costs more per car, as its cars no longer fit the processor's cache."""


@dataclass(frozen=True)
class Batch:
    """Some encounters of one scenario under one method.

    Attributes:
        scenario: The scenario, variation applied.
        variation: What was varied, such as `acc.headway=1.0`; empty for the scenario as it is.
        method: The method.
        model: Its learned model, if it needs one.
        encounters: The cases.
        seed: SUMO's seed.
        left_out: Names of cases of the scenario that do not fit on its ramp.
    """

    scenario: Scenario
    variation: str
    method: Method
    model: IntentionModel | None
    encounters: Encounters
    seed: int = 0
    left_out: tuple[str, ...] = ()

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
        """Speed limit and cycle of the batch."""
        return Setting(speed_limit=self.scenario.speed_limit or ramp.speed_limit)


class Workplace:
    """Keeps one SUMO open from batch to batch, as long as ramp and seed stay the same."""

    def __init__(self, tiles: int = TILES) -> None:
        self._tiles = tiles
        self._open: tuple[str, int, int] | None = None
        self._plant: SumoPlant | None = None

    def plant(self, ramp: Ramp, cases: int, seed: int) -> SumoPlant:
        """A plant on this ramp, with no more tiles than there are cases."""
        tiles = min(self._tiles, cases)
        wanted = (str(ramp.net), tiles, seed)
        if self._plant is None or self._open != wanted:
            self.close()
            self._plant, self._open = SumoPlant(ramp, tiles, seed), wanted
        return self._plant

    def close(self) -> None:
        """End the simulation."""
        if self._plant is not None:
            self._plant.close()
            self._plant = None


def run_batch(batch: Batch, workplace: Workplace) -> tuple[pa.Table, Effort]:
    """Simulate a batch and return its result rows and what they cost."""
    ramp = Ramp.load(batch.scenario.ramp)
    plant = workplace.plant(ramp, len(batch.encounters), batch.seed)
    run = simulate_batch(batch, plant, ramp)
    return rows_of(batch, run, ramp), run.effort


def simulate_batch(batch: Batch, plant: Plant, ramp: Ramp, traced: Sequence[int] = ()) -> Run:
    """Simulate a batch on a given plant; the human host needs none."""
    if batch.method.is_human:
        car, rules = batch.scenario.merging_car(), batch.scenario.test
        return simulate_human(batch.encounters, car, rules, batch.setting(ramp), tuple(traced))
    return simulate(
        plant,
        batch.encounters,
        batch.method.driver(batch.model),
        batch.scenario.merging_car(),
        batch.scenario.test,
        batch.setting(ramp),
        traced,
        batch.seed,
    )


def rows_of(batch: Batch, run: Run, ramp: Ramp) -> pa.Table:
    """The result rows of a batch's run."""
    settings = {key.partition(".")[2]: value for key, value in batch.method.settings if key.startswith("acc.")}
    law = controllers.build("acc", settings, batch.method.name)
    assert isinstance(law, Acc)
    return result_rows(run, batch.encounters, batch.setting(ramp), law, batch.names)

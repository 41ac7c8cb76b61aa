"""Scenes as tasks of a sweep: each is one SUMO simulation of living traffic, and its cases are the meetings in it."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa

from merge_cosim.controllers.law import FreeDriving
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import DT, FloatArray
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.rows import result_rows
from merge_cosim.results.statistics.summary import TRAFFIC
from merge_cosim.results.store import with_scene_facts
from merge_cosim.scenarios.sources import Routes, Traffic
from merge_cosim.scoring.scoring import Rules
from merge_cosim.simulation.loop import Effort
from merge_cosim.simulation.worlds.meeting_scores import encounters_of, score, to_be_scored
from merge_cosim.simulation.worlds.meetings import Ending, Meeting
from merge_cosim.simulation.worlds.traffic import Scene, SceneRun, run_scene
from merge_cosim.sumo.configuration import Configuration
from merge_cosim.sumo.demand import write_traffic
from merge_cosim.sweeps.task import Task, WorkerSession

USUAL_LENGTH = 600.0
"""Length of a scene [s] where its configuration does not say."""


@dataclass(frozen=True, kw_only=True)
class SceneBatch(Task):
    """Some scenes of one scenario under one method: the same traffic under different seeds.

    Attributes:
        first, last: The scenes `first` to `last - 1`.
    """

    first: int
    last: int
    most: int = 1

    def __len__(self) -> int:
        return self.last - self.first

    def case(self, number: int) -> str:
        """Name of a scene, which begins the names of its meetings."""
        return f"{self.first + number:03d}"

    def part(self, first: int, last: int) -> Self:
        """Some of the scenes."""
        return replace(self, first=self.first + first, last=self.first + last)

    def cycles(self) -> FloatArray:
        """Cycles of each scene, once per car that is usually there, shape (len(self),)."""
        traffic = self.scenario.encounters
        length = traffic.demand.duration if isinstance(traffic, Traffic) else USUAL_LENGTH
        return np.full(len(self), length / DT)

    def digest(self) -> str:
        """A short hash of the files that a scene consists of; what generated traffic depends on is in the scenario."""
        files = Configuration.read(self.file).files if self.file else (Ramp.load(self.scenario.ramp).net,)
        held = hashlib.sha256(f"{self.first} {self.last}".encode())
        for file in files:
            held.update(file.read_bytes())
        return held.hexdigest()[:16]

    @property
    def file(self) -> Path | None:
        """The user's `.sumocfg`, if it is one's."""
        return self.scenario.encounters.file if isinstance(self.scenario.encounters, Routes) else None

    def run(self, worker_session: WorkerSession) -> tuple[pa.Table, Effort]:
        """Simulate the scenes, one after the other; their facts are in the table's metadata."""
        worker_session.close()  # libsumo holds one simulation per process
        effort, tables, facts = Effort(), [], []
        for number in range(len(self)):
            with self.scene(number) as scene:
                run = self.simulate(scene)
            effort.add(run.effort)
            tables.append(self.rows(run, scene))
            facts.append(self.facts(run, scene))
        return with_scene_facts(pa.concat_tables(tables), facts), effort

    @contextmanager
    def scene(self, number: int) -> Iterator[Scene]:
        """A scene with its files, which are there as long as the context is."""
        traffic, ramp = self.scenario.encounters, Ramp.load(self.scenario.ramp)
        assert isinstance(traffic, (Traffic, Routes))
        with tempfile.TemporaryDirectory(prefix="merge-cosim-") as folder:
            announced: tuple[str, ...] = ()
            if isinstance(traffic, Traffic):
                file = write_traffic(Path(folder), traffic.demand, ramp)
                end, warm_up = traffic.demand.duration, traffic.demand.warm_up
            else:
                file, warm_up = traffic.file, 0.0
                configuration = Configuration.read(file)
                end, announced = traffic.end or configuration.end, configuration.hosts(traffic.host)
            yield Scene(
                name=self.case(number),
                file=file,
                ramp=ramp,
                seed=self.seed + traffic.seed + self.first + number,
                end=end,
                warm_up=warm_up,
                host=traffic.host,
                announced=announced,
                attention=traffic.attention,
            )

    def simulate(self, scene: Scene, **how: Any) -> SceneRun:
        """Run a scene under the method; `how` goes to `run_scene`."""
        driver = self.method.driver(self.model)
        return run_scene(scene, driver, self.setting(scene.ramp), self.scenario.test.horizon, **how)

    def rows(self, run: SceneRun, scene: Scene) -> pa.Table:
        """One result row for each meeting in which the car merged next to the host."""
        rules, setting, law = self.scenario.test, self.setting(scene.ramp), self.scenario.test.free
        return meeting_rows(run.meetings, scene.name, scene.ramp, rules, setting, law, self.names)

    def facts(self, run: SceneRun, scene: Scene) -> dict[str, Any]:
        """What there is to say of a scene as a whole."""
        notes = [(str(event), line) for event, line in run.notes]
        return {**self.names, "scene": scene.name, "seed": scene.seed, **run.facts, "notes": notes}


def meeting_rows(
    meetings: Sequence[Meeting],
    scene: str,
    ramp: Ramp,
    rules: Rules,
    setting: Setting,
    law: FreeDriving,
    names: dict[str, str],
) -> pa.Table:
    """Result rows of the meetings in which the car merged next to the host, one each.

    Args:
        meetings: All meetings of a scene.
        scene: Name of the scene.
        ramp: Where it was.
        rules: How they are scored.
        setting: Speed of free driving and cycle.
        law: The law whose free driving delays are measured against.
        names: `scenario`, `variation`, `method` and `model` of all rows.
    """
    chosen = to_be_scored(meetings)
    encounters = encounters_of(chosen, scene, ramp.name, TRAFFIC)
    scored, others = score(chosen, encounters, rules)
    unfinished = ~scored.columns["scored_to_end"] & (scored.columns["kind"] == 0)
    cut_off = np.array([meeting.ending is Ending.CENSORED for meeting in chosen], dtype=bool)
    more = {
        **{name: pa.array(values, mask=~np.isfinite(values)) for name, values in others.items()},
        "censored": unfinished & cut_off,
        "merging_stopped": np.array([meeting.stopped for meeting in chosen], dtype=bool),
    }
    return result_rows(scored, encounters, setting, law, names, more)

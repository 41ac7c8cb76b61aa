"""What a task runs in living traffic: scenes, whose encounters are found on the way."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT, FloatArray, IntArray
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scenarios.sources import Routes, Traffic
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.loop import Run
from merge_cosim.simulation.worlds.notes import Event
from merge_cosim.simulation.worlds.scene import Scene
from merge_cosim.sumo.configuration import Configuration
from merge_cosim.sumo.demand import write_traffic
from merge_cosim.sweeps.cases import Cases, Facts, Opened, RunOptions
from merge_cosim.sweeps.worker_session import WorkerSession

USUAL_LENGTH = 600.0
"""Length of a scene [s] where its configuration does not say."""
_NOTHING = (Event.NO_HOST, Event.HOST_NOT_DEPARTED, Event.NO_MERGING, Event.NOT_DEPARTED)
"""What makes a scene one without a meeting."""


def refuse_empty(facts: Facts, where: str) -> None:
    """Refuse scenes of which none has a meeting, so that there is nothing to measure. Pairs have no facts.

    Raises:
        UserError: There are scenes, and no meeting.
    """
    if not facts or any(one["meetings"] for one in facts):
        return
    first: dict[str, str] = {}
    for event, line in facts[0]["notes"]:
        first.setdefault(event, line)
    causes = [first[event] for event in _NOTHING if event in first]
    why = "; ".join(causes) or "hosts and merging cars never came near each other"
    raise UserError(f"{where}: nothing to measure: {why}")


@dataclass(frozen=True)
class TrafficCases(Cases):
    """Scenes of living traffic, which differ by SUMO's seed; their encounters are found on the way.

    Attributes:
        traffic: Where the cars come from.
        first, last: The scenes `first` to `last - 1`.
    """

    scenes: ClassVar[bool] = True
    most: ClassVar[int] = 1
    traffic: Traffic | Routes
    first: int
    last: int

    @property
    def encounters(self) -> None:
        """See `Cases`."""
        return None

    def __len__(self) -> int:
        return self.last - self.first

    def name(self, number: int) -> str:
        """See `Cases`; it begins the names of the scene's encounters."""
        return f"{self.first + number:03d}"

    def part(self, first: int, last: int) -> Self:
        """See `Cases`."""
        return replace(self, first=self.first + first, last=self.first + last)

    def take(self, rows: IntArray) -> Self:
        """See `Cases`; the scenes must follow each other."""
        return self.part(int(rows[0]), int(rows[-1]) + 1)

    def number(self, case: str) -> int | None:
        """See `Cases`; `SCENE` or `SCENE/HOST/MERGING`."""
        scene = case.partition("/")[0]
        return next((number for number in range(len(self)) if self.name(number) == scene), None)

    def cycles(self, rules: Rules) -> FloatArray:
        """See `Cases`; once per car that is usually there."""
        length = self.traffic.demand.duration if isinstance(self.traffic, Traffic) else USUAL_LENGTH
        return np.full(len(self), length / DT)

    def digest(self, ramp: Ramp) -> str:
        """See `Cases`; of the files of a scene. What generated traffic depends on is in the scenario."""
        files = Configuration.read(self.traffic.file).files if isinstance(self.traffic, Routes) else (ramp.net,)
        held = hashlib.sha256(f"{self.first} {self.last}".encode())
        for file in files:
            held.update(file.read_bytes())
        return held.hexdigest()[:16]

    def worlds(
        self, ramp: Ramp, seed: int, worker_session: WorkerSession, options: RunOptions, human: bool
    ) -> Iterator[AbstractContextManager[Opened]]:
        """See `Cases`; one world per scene."""
        worker_session.close()
        for number in range(len(self)):
            yield self.part(number, number + 1)._opened(ramp, seed, options)

    @contextmanager
    def _opened(self, ramp: Ramp, seed: int, options: RunOptions) -> Iterator[Opened]:
        with (
            self.scene(ramp, seed) as scene,
            scene.opened(options.gui_delay, options.extra, options.attach) as world,
        ):

            def facts(run: Run) -> Facts:
                if options.attach is None:
                    world.note_absent(scene.announced, scene.departures)
                else:
                    world.note_absent()
                run.effort.scene_s = world.time - world.begun_at
                notes = [(str(event), line) for event, line in world.notes.lines]
                return [{"scene": scene.name, "seed": scene.seed, **scene.facts(world), "notes": notes}]

            yield Opened(world, scene.seed, facts)

    @contextmanager
    def scene(self, ramp: Ramp, seed: int) -> Iterator[Scene]:
        """The first scene with its files, which are there as long as the context is."""
        traffic = self.traffic
        with tempfile.TemporaryDirectory(prefix="merge-cosim-") as folder:
            announced: tuple[str, ...] = ()
            departures: dict[str, float] = {}
            if isinstance(traffic, Traffic):
                file = write_traffic(Path(folder), traffic.demand, ramp)
                end, warm_up = traffic.demand.duration, traffic.demand.warm_up
            else:
                file, warm_up = traffic.file, 0.0
                configuration = Configuration.read(file)
                end, announced = traffic.end or configuration.end, configuration.hosts(traffic.host)
                departures = configuration.departures()
            yield Scene(
                name=self.name(0),
                file=file,
                ramp=ramp,
                seed=seed + traffic.seed + self.first,
                end=end,
                warm_up=warm_up,
                host=traffic.host,
                announced=announced,
                departures=departures,
                attention=traffic.attention,
            )

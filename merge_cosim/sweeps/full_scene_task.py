"""Full-scene replay as a task of a sweep: the pairs of a replay, each among all logged cars of its recording."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import pyarrow as pa

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import TOLERANCE, IntArray
from merge_cosim.ngsim.pairing.recordings import LoggedScene, episode_scenes, pair_in_scene, site_scenes
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.ngsim.surrogate.surrogate import surrogate_folder
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.store import with_scene_facts
from merge_cosim.scenarios.scenario import Scenario
from merge_cosim.scenarios.sources import Pairs
from merge_cosim.scoring.scoring import HOST_INTO_LEADER
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Effort, Run
from merge_cosim.simulation.worlds.logged import LoggedWorld, Place
from merge_cosim.simulation.worlds.tiles import World
from merge_cosim.sweeps.task import Batch, WorkerSession


@dataclass(frozen=True, kw_only=True)
class SceneReplay(Batch):
    """Some encounters, each run as a scene.

    Attributes:
        places: The scene of each, and where in it.
    """

    places: tuple[Place, ...]
    most: int = 1

    @classmethod
    def of(cls, batch: Batch, scenes: dict[str, LoggedScene]) -> Self:
        """Find the scenes of a batch's encounters.

        Raises:
            UserError: There is none for an encounter.
        """
        own = {name: value for name, value in vars(batch).items() if name != "most"}
        try:
            places = [pair_in_scene(scenes, batch.encounters, row) for row in range(len(batch))]
        except KeyError as error:
            raise UserError(f"scenario {batch.scenario.name}: no scene holds the pair ({error})") from None
        return cls(**own, places=tuple(places))

    def part(self, first: int, last: int) -> Self:
        """The cases `first` to `last - 1`, with their scenes."""
        return replace(super().part(first, last), places=self.places[first:last])

    def take(self, rows: IntArray) -> Self:
        """The chosen cases, in that order, with their scenes."""
        return replace(super().take(rows), places=tuple(self.places[int(row)] for row in rows))

    def digest(self) -> str:
        """A short hash of the encounters and of all cars around them."""
        scenes = {scene.recording: scene.digest for scene, _ in self.places}
        return hashlib.sha256(f"{super().digest()} {scenes}".encode()).hexdigest()[:16]

    def run(self, worker_session: WorkerSession) -> tuple[pa.Table, Effort]:
        """Simulate the scenes one after the other; their facts are in the table's metadata."""
        ramp = Ramp.load(self.scenario.ramp)
        world = self.world(worker_session, ramp)
        run = self.simulate(world, ramp)
        world.close()
        facts = [
            {**self.names, "scene": self.case(number), "seed": self.seed, **world.facts[number]}
            for number in sorted(world.facts)
        ]
        return with_scene_facts(self.rows(run, ramp), facts), run.effort

    def world(self, worker_session: WorkerSession, ramp: Ramp) -> LoggedWorld:
        """A world of these scenes, in the place of the one that is open."""
        return worker_session.hold(self.open(ramp))

    def open(self, ramp: Ramp, gui_delay: int | None = None, extra: tuple[str, ...] = ()) -> LoggedWorld:
        """A world of these scenes; see `LoggedWorld`."""
        assert self.scenario.full_scene is not None
        return LoggedWorld(ramp, self.places, self.scenario.full_scene, self.seed, gui_delay, extra)

    def driver(self, world: World) -> HostDriver:
        """The method, which heeds its leader."""
        driver = super().driver(world)
        return driver if self.method.is_human else self._of(world).among(driver)

    def finished(self, world: World, run: Run) -> Run:
        """Add what was around the host."""
        if self.method.is_human:
            return run
        world = self._of(world)
        columns = run.columns | world.around
        hit = (columns["kind"] == 0) & (columns["min_leader_gap_m"] < -TOLERANCE)
        columns["kind"] = np.where(hit, HOST_INTO_LEADER, columns["kind"])
        return replace(run, columns=columns, effort=replace(run.effort, vehicle_steps=world.vehicle_steps))

    @staticmethod
    def _of(world: World) -> LoggedWorld:
        assert isinstance(world, LoggedWorld)
        return world


def load_scenes(scenario: Scenario, source: str, data: Path | None) -> dict[str, LoggedScene]:
    """Return the scenes of a replay's sites, by recording.

    Args:
        scenario: The scenario.
        source: The source of its encounters, `ngsim` or `surrogate`.
        data: Folder with NGSIM files.

    Raises:
        UserError: A file is damaged.
    """
    pairs = scenario.encounters
    assert isinstance(pairs, Pairs)
    scenes: dict[str, LoggedScene] = {}
    for name in pairs.sites:
        site = find_site(name)
        if source == "surrogate":
            scenes |= site_scenes(surrogate_folder(site), site, pairs.rules)
        elif data is not None:
            scenes |= {**episode_scenes(data, site, pairs.rules), **site_scenes(data, site, pairs.rules)}
    return scenes

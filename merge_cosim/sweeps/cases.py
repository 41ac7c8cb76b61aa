"""What a task runs: encounters of pairs, or encounters among logged cars; scenes of traffic are in `traffic_cases`."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.ngsim.pairing.recordings import LoggedScene, pair_in_scene
from merge_cosim.ramps.ramp import Ramp, Way
from merge_cosim.ramps.view import view_options
from merge_cosim.scenarios.random_states import RandomStates
from merge_cosim.scoring.rules import Rules, expected_cycles
from merge_cosim.simulation.loop import Run
from merge_cosim.simulation.worlds.base import World, WorldKind
from merge_cosim.simulation.worlds.logged import LoggedWorld, Place
from merge_cosim.simulation.worlds.logged_host import LoggedHostWorld
from merge_cosim.simulation.worlds.logged_rules import FullScene
from merge_cosim.simulation.worlds.tiles import TiledWorld
from merge_cosim.sumo.attach import Address, AttachedSession
from merge_cosim.sumo.options import delay_option
from merge_cosim.sumo.start import TraciSession
from merge_cosim.sumo.tiles import tile_id
from merge_cosim.sweeps.worker_session import WorkerSession

CHUNK_CASES = 1_000
"""Most encounters that are handed out at a time: enough to keep the tiles busy, few enough to lose little when
interrupted."""

Facts = list[dict[str, Any]]
"""What there is to say of scenes as a whole; none for pairs."""


class Opened(NamedTuple):
    """A world to run in.

    Attributes:
        world: The world.
        seed: Seed of the random streams of its encounters.
        facts: What gives the facts of a finished run.
    """

    world: World
    seed: int
    facts: Callable[[Run], Facts]


@dataclass(frozen=True)
class RunOptions:
    """How a single case is run otherwise than in a sweep.

    Attributes:
        gui_delay: Milliseconds per step in sumo-gui; None runs without a window.
        extra: Further options of SUMO.
        attach: Drive in the SUMO that listens there, instead of a new one.
    """

    gui_delay: int | None = None
    extra: tuple[str, ...] = ()
    attach: Address | None = None


AS_IN_A_SWEEP = RunOptions()


class Cases(ABC):
    """Some cases of a scenario.

    Attributes:
        world: What moves their cars, see `World.kind`.
        scenes: Their encounters are found on the way.
        most: Most of them that are handed out at a time.
    """

    world: ClassVar[WorldKind] = "sumo"
    scenes: ClassVar[bool] = False
    most: ClassVar[int]

    @property
    @abstractmethod
    def encounters(self) -> Encounters | None:
        """The encounters; None where they are found on the way. Random ones are drawn anew at each call."""

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def name(self, number: int) -> str:
        """Name of a case."""

    @abstractmethod
    def part(self, first: int, last: int) -> Self:
        """The cases `first` to `last - 1`."""

    @abstractmethod
    def take(self, rows: IntArray) -> Self:
        """The chosen cases, in that order."""

    @abstractmethod
    def cycles(self, rules: Rules) -> FloatArray:
        """Expected cycles of each case, shape (len(self),)."""

    @abstractmethod
    def digest(self, ramp: Ramp) -> str:
        """A short hash of what the cases hold."""

    @abstractmethod
    def worlds(
        self, ramp: Ramp, seed: int, worker_session: WorkerSession, options: RunOptions, human: bool
    ) -> Iterator[AbstractContextManager[Opened]]:
        """The worlds in which the cases are run, one after the other; each is closed before the next is opened.

        Args:
            ramp: The ramp.
            seed: SUMO's seed.
            worker_session: Keeps a SUMO open from chunk to chunk.
            options: How a single case is run.
            human: The hosts drive as they were logged, without SUMO.
        """

    @abstractmethod
    def number(self, case: str) -> int | None:
        """Number of a case by its name, or of the one in which it is found; None if there is none."""

    def find(self, case: str) -> int:
        """The same.

        Raises:
            UserError: There is none.
        """
        number = self.number(case)
        if number is not None:
            return number
        if len(self) <= 12:
            few = did_you_mean(case, [self.name(number) for number in range(len(self))])
        else:
            few = f" (such as {self.name(0)}, {self.name(len(self) - 1)})"
        raise UserError(f"no case '{case}'{few}")


@dataclass(frozen=True)
class PairCases(Cases):
    """Encounters of a host and a merging car without other cars.

    Attributes:
        pairs: The encounters.
        host: Where the hosts drive.
    """

    most: ClassVar[int] = CHUNK_CASES
    pairs: Encounters | RandomStates
    host: Way = field(default="main", kw_only=True)

    @property
    def encounters(self) -> Encounters:
        """See `Cases`."""
        return self.pairs if isinstance(self.pairs, Encounters) else self.pairs.encounters()

    def __len__(self) -> int:
        return len(self.pairs)

    def name(self, number: int) -> str:
        """See `Cases`."""
        pairs = self.pairs if isinstance(self.pairs, Encounters) else self.pairs.part(number, number + 1).encounters()
        return str(pairs.case[number if pairs is self.pairs else 0])

    def part(self, first: int, last: int) -> Self:
        """See `Cases`."""
        return replace(self, pairs=self.pairs.part(first, last))

    def take(self, rows: IntArray) -> Self:
        """See `Cases`."""
        return replace(self, pairs=self.pairs.take(rows))

    def number(self, case: str) -> int | None:
        """See `Cases`."""
        if isinstance(self.pairs, RandomStates):
            return self.pairs.find(case)
        found = np.flatnonzero(self.pairs.case == case)
        return int(found[0]) if len(found) else None

    def cycles(self, rules: Rules) -> FloatArray:
        """See `Cases`."""
        return expected_cycles(self.encounters, rules)

    def digest(self, ramp: Ramp) -> str:
        """See `Cases`."""
        return self.pairs.digest

    def worlds(
        self, ramp: Ramp, seed: int, worker_session: WorkerSession, options: RunOptions, human: bool
    ) -> Iterator[AbstractContextManager[Opened]]:
        """See `Cases`; a single world."""
        if human:
            yield nullcontext(Opened(LoggedHostWorld(len(self)), seed, no_facts))
        else:
            yield self._opened(ramp, seed, worker_session, options)

    @contextmanager
    def _opened(self, ramp: Ramp, seed: int, worker_session: WorkerSession, options: RunOptions) -> Iterator[Opened]:
        if options == AS_IN_A_SWEEP:
            yield Opened(worker_session.world(ramp, len(self), seed, self.host), seed, no_facts)
        else:
            worker_session.close()
            world = _single_world(ramp, seed, options, self.host)
            try:
                yield Opened(world, seed, no_facts)
            finally:
                world.close()


def no_facts(run: Run) -> Facts:
    """Of encounters of pairs."""
    return []


def _single_world(ramp: Ramp, seed: int, options: RunOptions, host: Way) -> TiledWorld:
    """SUMO for one encounter."""
    attach = options.attach
    if attach is not None:
        return TiledWorld(ramp, 1, seed, lambda sumo: AttachedSession(sumo, attach), tiled=False, host=host)
    if options.gui_delay is None:
        return TiledWorld(ramp, 1, seed, extra=options.extra, host=host)
    shown = (*view_options(ramp.net.parent), *delay_option(options.gui_delay))
    world = TiledWorld(ramp, 1, seed, partial(TraciSession, gui=True), (*shown, *options.extra), host=host)
    world.session.follow(tile_id(0, "host"))
    world.shown = True
    return world


@dataclass(frozen=True)
class LoggedCases(PairCases):
    """Encounters among all cars that were logged with them.

    Attributes:
        full_scene: How the other cars take part.
        places: The scene of each encounter, and where in it.
    """

    most: ClassVar[int] = 1
    full_scene: FullScene
    places: tuple[Place, ...]

    @classmethod
    def of(cls, pairs: Encounters, full_scene: FullScene, scenes: dict[str, LoggedScene]) -> Self:
        """Find the scenes of some encounters.

        Raises:
            UserError: There is none for an encounter.
        """
        try:
            places = tuple(pair_in_scene(scenes, pairs, row) for row in range(len(pairs)))
        except KeyError as error:
            raise UserError(f"no scene holds the pair ({error})") from None
        return cls(pairs, full_scene, places)

    def part(self, first: int, last: int) -> Self:
        """See `Cases`."""
        return replace(super().part(first, last), places=self.places[first:last])

    def take(self, rows: IntArray) -> Self:
        """See `Cases`."""
        return replace(super().take(rows), places=tuple(self.places[int(row)] for row in rows))

    def digest(self, ramp: Ramp) -> str:
        """See `Cases`; of all cars around the encounters, too."""
        scenes = {scene.recording: scene.digest for scene, _ in self.places}
        return hashlib.sha256(f"{super().digest(ramp)} {scenes}".encode()).hexdigest()[:16]

    @contextmanager
    def _opened(self, ramp: Ramp, seed: int, worker_session: WorkerSession, options: RunOptions) -> Iterator[Opened]:
        if options.attach is not None:
            raise UserError("--attach: not with full_scene, which starts SUMO with a recording's cars; leave it out")
        worker_session.close()
        world = LoggedWorld(ramp, self.places, self.full_scene, seed, options.gui_delay, options.extra)
        try:
            yield Opened(
                world,
                seed,
                lambda _: [{"scene": self.name(n), "seed": seed, **world.facts[n]} for n in sorted(world.facts)],
            )
        finally:
            world.close()

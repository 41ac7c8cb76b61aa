"""Base class of worlds. A world moves the cars of encounters; an encounter has a slot from its begin to its end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal, TypeAlias

import numpy as np

from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import Setting
from merge_cosim.core.random_streams import Keys, stream_keys
from merge_cosim.core.units import AnyArray, BoolArray, FloatArray, IntArray
from merge_cosim.scoring.rules import Rules, expected_cycles

if TYPE_CHECKING:
    from merge_cosim.simulation.leader import LeaderRule

WorldKind: TypeAlias = Literal["sumo", "closed-form"]
"""What moves the cars: SUMO, or `s' = s + v dt`."""
KINDS: dict[WorldKind, tuple[str, str]] = {
    "sumo": ("SUMO; the default", "every scenario, windows and SUMO's output files"),
    "closed-form": ("s' = s + v dt, thousands of encounters side by side", "scenarios of pairs, without other cars"),
}
"""What moves the cars in each, and what it takes."""


@dataclass(frozen=True)
class Begun:
    """Encounters that begin in the present cycle; m of them.

    Attributes:
        slots: Where, shape (m,).
        cases: Their numbers in `World.encounters`, where these are known beforehand. Shape (m,).
        start: Stations of host and merging car, their speeds, their lengths [m, m/s, m], shape (6, m).
        labels: Intention of each driver by its log or script (`Intention`), shape (m,).
        keys: Keys of their random streams, shape (m,).
        score_until: Last cycle of each that may be scored; `NEVER` without one. Shape (m,).
        around: Values of the world's channels, shape (channels, m).
    """

    slots: IntArray
    cases: IntArray
    start: FloatArray
    labels: IntArray
    keys: Keys
    score_until: IntArray
    around: FloatArray


@dataclass(frozen=True)
class Ended:
    """Encounters that have ended; their slots are free.

    Attributes:
        slots: Where, shape (m,).
        cases: Their numbers in `World.encounters`; -1 for those that are not scored. Shape (m,).
        names: Their names.
        back: Number of the last recorded states that lie after their end.
        begun_at: Time in the world at which each began [s], shape (m,).
        points: Place of station 0, for worlds that know it only once the car has merged [m past the gore].
    """

    slots: IntArray
    cases: IntArray
    names: AnyArray
    back: int = 0
    begun_at: FloatArray | None = None
    points: FloatArray | None = None


class World(ABC):
    """Moves the cars of a simulation. The loop (`merge_cosim.simulation.loop`) does not know which world it drives.

    One cycle is: `command`, `step`, `observe`, `ended`, `begin`.

    Attributes:
        kind: What moves the cars.
        channels: What is recorded of each encounter and cycle beside both cars' states.
        can_thin: It can leave out slots in which nothing more begins, see `thin`.
        slots: Number of slots; it may grow.
        commanded: The hosts are driven by the method, so its bounds of acceleration are checked.
        step_s: Time [s] inside the simulator's steps, without the time to command and to read cars.
        calls_s: Time [s] inside the calls that place, command and read cars, where the world takes it.
        vehicle_steps: Cars times steps, where the world counts them; None for the two cars of each encounter.
        shown: It is shown in a window, which also shows what the hosts believe and decide.
        worst_difference_m: Largest difference of the stations from the closed form, at an encounter's end [m].
    """

    kind: ClassVar[WorldKind] = "sumo"
    channels: ClassVar[tuple[str, ...]] = ()
    can_thin: ClassVar[bool] = False
    commanded: ClassVar[bool] = True
    slots: int
    step_s: float = 0.0
    calls_s: float = 0.0
    vehicle_steps: int | None = None
    shown: bool = False
    worst_difference_m: float = 0.0

    @abstractmethod
    def start(
        self, encounters: Encounters | None, setting: Setting, rules: Rules, leader: LeaderRule, seed: int
    ) -> None:
        """Make ready for a run.

        Args:
            encounters: What is to be run; None for a world that finds its encounters.
            setting: Speed limit and cycle.
            rules: When an encounter is scored.
            leader: How a host drives behind a leader, and freely.
            seed: Seed of the encounters' random streams.
        """

    @property
    @abstractmethod
    def goes_on(self) -> bool:
        """There is something left to simulate."""

    @property
    @abstractmethod
    def encounters(self) -> Encounters:
        """All encounters of the run; of a world that finds them those that are to be scored so far."""

    @abstractmethod
    def begin(self) -> Begun | None:
        """Begin encounters in free slots; None if there are none."""

    @abstractmethod
    def command(self, speeds: FloatArray) -> None:
        """Set the speeds [m/s] of the next step, of hosts and merging cars, shape (2, slots)."""

    @abstractmethod
    def step(self) -> None:
        """Simulate one cycle and read the new states."""

    @abstractmethod
    def observe(self, state: FloatArray, around: FloatArray) -> None:
        """Write what can be observed: stations and speeds, shape (4, slots), and the channels, (channels, slots)."""

    @abstractmethod
    def ended(self, over: IntArray, age: IntArray) -> Ended | None:
        """Free the slots of encounters that have ended by the present state; None if there are none.

        Args:
            over: Slots of the encounters whose scoring ends with the present state.
            age: Cycles since each slot's encounter began, shape (slots,).
        """

    def thin(self, slots: IntArray) -> None:
        """Go on with the encounters in `slots` alone, in that order; no other encounter begins any more."""

    def finish(self, age: IntArray) -> Ended | None:
        """End what is still open when the run ends."""
        return None

    def show(self, log_odds: FloatArray) -> None:
        """Show what the hosts believe and decide, where `shown`, before the next step; shape (slots,)."""

    @property
    def leader(self) -> FloatArray | None:
        """Gap to the car ahead of each host [m], inf without one, and its speed [m/s], shape (2, slots)."""
        return None

    @property
    def room(self) -> FloatArray:
        """How far each merging car can go on beside the host lane before it comes in [m], shape (slots,).

        It is 0 where the car comes in at station 0.
        """
        return np.zeros(self.slots)

    def settled(self, track: FloatArray, point: float) -> FloatArray:
        """A recorded track with its stations relative to `Ended.points`."""
        return track

    def columns(self) -> dict[str, AnyArray]:
        """Further columns of the encounters, shape (n,) each; `sumo_collision`: SUMO reported their contact."""
        return {"sumo_collision": np.zeros(len(self.encounters), dtype=bool)}

    def broken(self) -> dict[str, BoolArray]:
        """Which encounters break an invariant that the world itself checks, shape (n,) each; see `INVARIANTS`."""
        return {}

    def close(self) -> None:
        """End the simulation."""


class GivenWorld(World):
    """A world whose encounters are known beforehand: a slot that becomes free takes the next one.

    The encounters that will last longest go first, so that all slots end together. A subclass defines `place`,
    `command`, `step` and `observe`.

    Attributes:
        collided: Slots in which a contact was reported since the encounter there began, shape (slots,).
    """

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self.collided = np.zeros(slots, dtype=bool)
        self._ever_collided = np.zeros(0, dtype=bool)
        self._case = np.full(slots, -1)
        self._active = 0

    @abstractmethod
    def place(self, slots: IntArray, cases: IntArray) -> FloatArray:
        """Put the encounters `cases` at their initial states into `slots`; returns their channels."""

    def start(
        self, encounters: Encounters | None, setting: Setting, rules: Rules, leader: LeaderRule, seed: int
    ) -> None:
        """See `World`."""
        assert encounters is not None
        self._encounters, n = encounters, len(encounters)
        self._keys = stream_keys(encounters.case, seed)
        self._score_until = np.full(n, NEVER) if encounters.log is None else encounters.log.score_until
        self._queue = np.argsort(-expected_cycles(encounters, rules), kind="stable")
        self._ever_collided = np.zeros(n, dtype=bool)
        self._broken: dict[str, BoolArray] = {}
        self.restart()
        self.worst_difference_m = 0.0

    def restart(self) -> None:
        """Free all slots; encounters in them are dropped."""
        self._case[:] = -1
        self._free = np.arange(self.slots)
        self._active = 0

    def line_up(self, cases: IntArray) -> None:
        """Make these encounters, shape (m,), the only ones to begin from now on; they may have run before."""
        self._queue = cases

    def thin(self, slots: IntArray) -> None:
        """See `World`."""
        self.slots = len(slots)
        self._case, self.collided = self._case[slots], self.collided[slots]
        self._free = np.zeros(0, dtype=np.int64)

    @property
    def encounters(self) -> Encounters:
        """See `World`."""
        return self._encounters

    @property
    def goes_on(self) -> bool:
        """See `World`."""
        return self._active > 0

    def begin(self) -> Begun | None:
        """See `World`."""
        count = min(len(self._free), len(self._queue))
        if not count:
            return None
        cases, self._queue = self._queue[:count], self._queue[count:]
        slots, self._free = self._free[:count], self._free[count:]
        self._case[slots] = cases
        self._active += count
        self.collided[slots] = False
        around = self.place(slots, cases)
        start, labels = self._encounters.start.take(cases, axis=1), self._encounters.label[cases]
        return Begun(slots, cases, start, labels, self._keys[cases], self._score_until[cases], around)

    def ended(self, over: IntArray, age: IntArray) -> Ended | None:
        """See `World`; an encounter ends when its scoring does."""
        if not len(over):
            return None
        cases = self._case[over]
        self._ever_collided[cases] = self.collided[over]
        self._case[over] = -1
        self._free = over
        self._active -= len(over)
        return Ended(over, cases, self._encounters.case[cases])

    def columns(self) -> dict[str, AnyArray]:
        """See `World`."""
        return {"sumo_collision": self._ever_collided}

    def broken(self) -> dict[str, BoolArray]:
        """See `World`."""
        return self._broken

    def breaks(self, invariant: str, slots: IntArray) -> None:
        """Note that the encounters in some slots break an invariant."""
        if len(slots):
            self._broken.setdefault(invariant, np.zeros(len(self._encounters), dtype=bool))[self._case[slots]] = True

"""The co-simulation loop: each cycle observe, estimate, decide and command, for all slots of a world at once."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace
from time import perf_counter, process_time

import numpy as np
import pandas as pd

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import AnyArray, BoolArray, FloatArray, IntArray
from merge_cosim.merging_cars.base import MergingCar
from merge_cosim.scoring.invariants import Bounds, broken
from merge_cosim.scoring.rules import Rules, Watch, end_of
from merge_cosim.scoring.scoring import score
from merge_cosim.scoring.tracks import Tracks
from merge_cosim.simulation.host_driver import DriverBlocks, HostDriver
from merge_cosim.simulation.leader import LeaderRule
from merge_cosim.simulation.recording import Recorder, trace_of
from merge_cosim.simulation.worlds.base import Ended, World, WorldKind

SCORED_TOGETHER = 128
"""Encounters that are over wait until so many can be scored in one go; their tracks then still fit the cache."""
SCORED_IN_PLACE = 512
"""The same where the recorder holds all of them, and nothing else needs the cache meanwhile."""
RECORDED_FIRST, ROOM = 128, 16
"""Cycles that the recorder holds at first, few enough for the cache, and how many more than the longest encounter has
lasted it always has room for."""
THINNED_AT, THINNED_FROM = 0.5, 512
"""Share of slots in use below which the others are left out, and the slots from which on that pays."""


@dataclass
class Effort:
    """What a batch cost.

    Attributes:
        vehicle_steps: Vehicles times steps of running encounters.
        encounter_cycles: Cycles of running encounters.
        wall_s: Time in the loop [s].
        cpu_s: Processor time in the loop [s].
        step_s: Of it, inside the steps of SUMO [s].
        calls_s: Of it, inside the calls that place, command and read cars, see `World.calls_s` [s].
        method_s: Of it, in estimating and controlling [s].
        scene_s: Simulated time of scenes [s].
        worst_difference_m: Largest difference of the world's stations from the closed form, at an encounter's end [m].
    """

    vehicle_steps: int = 0
    encounter_cycles: int = 0
    wall_s: float = 0.0
    cpu_s: float = 0.0
    step_s: float = 0.0
    calls_s: float = 0.0
    method_s: float = 0.0
    scene_s: float = 0.0
    worst_difference_m: float = 0.0

    def add(self, other: Effort) -> None:
        """Sum two batches."""
        self.vehicle_steps += other.vehicle_steps
        self.encounter_cycles += other.encounter_cycles
        self.wall_s += other.wall_s
        self.cpu_s += other.cpu_s
        self.step_s += other.step_s
        self.calls_s += other.calls_s
        self.method_s += other.method_s
        self.scene_s += other.scene_s
        self.worst_difference_m = max(self.worst_difference_m, other.worst_difference_m)


@dataclass
class Run:
    """What came out of a batch of n encounters.

    Attributes:
        encounters: The encounters.
        columns: All measures of `score`, `sumo_collision`, and what the world adds; shape (n,) each.
        broken: Which encounters break an invariant, shape (n,) each, for those that are broken at all.
        effort: What it cost.
        world: What moved the cars, see `World.kind`.
        traces: For each traced encounter, by name, one row per cycle; see `trace_of`.
    """

    encounters: Encounters
    columns: dict[str, AnyArray]
    effort: Effort
    world: WorldKind
    broken: dict[str, BoolArray] = field(default_factory=dict)
    traces: dict[str, pd.DataFrame] = field(default_factory=dict)


class Everything(Container[str]):
    """Holds every name: to trace all encounters."""

    def __contains__(self, name: object) -> bool:
        return True


class Loop:
    """Runs encounters in a world, each until it is scored, fails or times out.

    Nothing that an encounter goes through depends on its slot or on its neighbours, so its outcome is the same
    whatever the batch and the number of slots. A caller that makes the world's steps itself calls `before_step` and
    `after_step` around each, and `finish` at the end, in place of `run`.
    """

    def __init__(
        self,
        world: World,
        encounters: Encounters | None,
        driver: HostDriver,
        merging_car: MergingCar,
        rules: Rules,
        setting: Setting,
        traced: Container[str] = (),
        seed: int = 0,
    ) -> None:
        """Make ready.

        Args:
            world: What moves the cars.
            encounters: The n encounters; None for a world that finds its encounters.
            driver: The host's method.
            merging_car: How the merging cars drive.
            rules: When an encounter is scored.
            setting: Speed limit and cycle.
            traced: Names of the encounters to record cycle by cycle.
            seed: Seed of the random streams, one per encounter.
        """
        self._world, self._merging_car, self._setting, self._rules = world, merging_car, setting, rules
        self._traced = traced
        self._leader = LeaderRule(driver.controller, setting)
        host = Bounds.of(driver.controller, self._leader.law) if world.commanded else Bounds()
        self._bounds = host, Bounds.of(merging_car)
        world.start(encounters, setting, rules, self._leader, seed)
        self._found = encounters is None
        if encounters is not None:
            merging_car.start(encounters, world.slots, setting)
        self._driver = DriverBlocks(driver, world.slots, setting)
        self._channels = () if traced == () else driver.controller.channels
        slot_each = encounters is not None and world.slots >= len(encounters)
        self._last = np.full(world.slots, -1) if slot_each and traced == () else None
        """The last cycle in each slot, where every encounter has one to itself: then the recorder holds them all."""
        longest = RECORDED_FIRST if self._last is None else rules.time_out_cycles
        self._recorder = Recorder(world.slots, longest, len(world.channels), len(self._channels))
        self._watch = Watch(world.slots, rules)
        self._age, self._over_at = np.zeros((2, 0), dtype=np.int64)
        self._active, self._open = np.zeros((2, 0), dtype=bool)
        self._make_room()
        self._cycles = 0
        self._effort, self._stepped, self._called = Effort(), world.step_s, world.calls_s
        self._over: dict[int, FloatArray] = {}
        self._cases, self._origin = np.zeros(world.slots, dtype=np.int64), np.arange(world.slots)
        """Case of each of those slots, and which of them each slot is since others have been left out."""
        self._can_thin = world.can_thin and driver.can_thin and merging_car.can_thin and self._last is not None
        self._columns: dict[str, AnyArray] = {}
        self._broken: dict[str, BoolArray] = {}
        self._traces: dict[str, pd.DataFrame] = {}

    def run(self) -> Run:
        """Run to the end."""
        begin, cpu = perf_counter(), process_time()
        self._begin()
        while self._world.goes_on:
            self.before_step()
            self._world.step()
            self.after_step()
            if self._can_thin and THINNED_FROM < len(self._age) > np.count_nonzero(self._active) / THINNED_AT:
                self._thin()
        run = self.finish()
        run.effort.wall_s, run.effort.cpu_s = perf_counter() - begin, process_time() - cpu
        return run

    def before_step(self) -> None:
        """Estimate, decide and command."""
        begin = perf_counter()
        now, world = self._recorder.seen, self._world
        observed = self._merging_car.observed_speed(self._age, now.merging_speed)
        seen = now if observed is now.merging_speed else replace(now, merging_speed=observed)
        leader, around = world.leader, None
        if leader is not None:
            around = np.vstack([leader, world.room])
        log_odds, acceleration = self._driver.decide(seen, self._active, around)
        if leader is not None:
            acceleration = self._leader.cap(acceleration, now.host_speed, leader)
        np.maximum(now.host_speed + acceleration * self._setting.dt, 0.0, out=self._speeds[0])
        self._effort.method_s += perf_counter() - begin
        self._speeds[1] = self._merging_car.next_speed(self._age, now)
        self._speeds *= self._active
        world.command(self._speeds)
        self._recorder.decided(log_odds, self._speeds[0])
        if world.shown:
            world.show(log_odds)
        if self._channels:
            self._recorder.record_channels(self._driver.channel_values())

    def after_step(self) -> None:
        """Observe, end what is over and begin what comes next."""
        world = self._world
        if self._last is None and self._cycles % ROOM == 0:
            longest = int((self._age * self._active).max(initial=0))
            self._recorder.make_room(world.slots, longest + ROOM)
        self._cycles += 1
        world.observe(*self._recorder.next_cycle())
        self._age += 1
        over = (self._open & self._watch.over(self._age, self._recorder.seen)).nonzero()[0]
        if len(over):
            self._over_at[over] = self._age[over]
            self._open[over] = False
        if ended := world.ended(over, self._age):
            self._finish(ended)
        if ended or self._found:
            self._begin()

    def finish(self) -> Run:
        """End what is still open, score, and return what came out."""
        if ended := self._world.finish(self._age):
            self._finish(ended)
        if self._last is not None:
            self._score_in_place(self._last)
        else:
            self._score()
        world, effort = self._world, self._effort
        if world.vehicle_steps is not None:
            effort.vehicle_steps = world.vehicle_steps
        effort.step_s, effort.calls_s = world.step_s - self._stepped, world.calls_s - self._called
        effort.worst_difference_m = world.worst_difference_m
        columns = self._columns | world.columns()
        return Run(world.encounters, columns, effort, world.kind, self._broken | world.broken(), self._traces)

    def _make_room(self) -> None:
        """Grow with the world, which may add slots."""
        slots = self._world.slots
        more = slots - len(self._age)
        if not more:
            return
        self._recorder.make_room(slots, 0)
        self._driver.make_room(slots)
        self._watch.make_room(slots)
        self._age, self._over_at = np.pad((self._age, self._over_at), ((0, 0), (0, more)))
        self._active, self._open = np.pad((self._active, self._open), ((0, 0), (0, more)))
        self._speeds = np.zeros((2, slots))

    def _begin(self) -> None:
        begun = self._world.begin()
        if self._found:
            self._make_room()
        if begun is None:
            return
        slots = begun.slots
        self._age[slots] = 0
        self._active[slots] = self._open[slots] = True
        self._over_at[slots] = -1
        self._recorder.begun(slots, begun.start, begun.around)
        self._driver.reset(slots, begun.labels, begun.keys)
        self._watch.reset(slots, begun.score_until)
        if not self._found:
            self._merging_car.reset(slots, begun.cases)

    def _finish(self, ended: Ended) -> None:
        """Take the tracks of encounters that have ended."""
        slots = ended.slots
        self._active[slots] = self._open[slots] = False
        self._driver.rest(slots)
        valid, over_at = self._age[slots] - ended.back, self._over_at[slots]
        last = np.where(over_at >= 0, np.minimum(over_at, valid), valid)
        if self._last is not None:
            before = self._origin[slots]
            self._last[before], self._cases[before] = last, ended.cases
            return
        ages, names = self._age[slots].tolist(), ended.names.tolist()
        for number, (slot, case, end) in enumerate(
            zip(slots.tolist(), ended.cases.tolist(), last.tolist(), strict=True)
        ):
            name = str(names[number])
            if case < 0 and name not in self._traced:
                continue
            track = self._recorder.track(slot, ages[number])
            if ended.points is not None:  # counted from there, it may have been over earlier or later
                track = self._world.settled(track[:, : int(valid[number]) + 1], float(ended.points[number]))
                end = end_of(self._recorder.states(track, slot), self._rules)
            track = track[:, : end + 1]
            if case >= 0:
                self._over[case] = track[: len(track) - len(self._channels)]
            if name in self._traced:
                begun_at = 0.0 if ended.begun_at is None else float(ended.begun_at[number])
                self._traces[name] = trace_of(track, (*self._world.channels, *self._channels), begun_at)
        self._age[slots] = 0
        if len(self._over) >= SCORED_TOGETHER and not self._found:
            self._score()

    def _score(self) -> None:
        """Score the encounters that are over and forget their tracks."""
        encounters = self._world.encounters
        if not self._over and self._columns:
            return
        tracks = Tracks.of(encounters, list(self._over), list(self._over.values()), self._world.channels)
        self._over.clear()
        self._take_scores(tracks)

    def _thin(self) -> None:
        """Leave out the slots of encounters that are over, so that a few long ones need not carry all others."""
        slots = np.flatnonzero(self._active)
        for part in (self._world, self._merging_car, self._driver, self._recorder, self._watch):
            part.thin(slots)
        self._age, self._over_at, self._origin = self._age[slots], self._over_at[slots], self._origin[slots]
        self._active, self._open = self._active[slots], self._open[slots]
        self._speeds = np.zeros((2, len(slots)))

    def _score_in_place(self, last: IntArray) -> None:
        """Score the encounters of a run in which each had a slot to itself, by neighbouring slots."""
        encounters = self._world.encounters
        for first in range(0, len(encounters), SCORED_IN_PLACE):
            slots = slice(first, min(first + SCORED_IN_PLACE, len(encounters)))
            rows = self._recorder.from_the_start(slots, last[slots])
            cases = self._cases[slots]
            self._take_scores(Tracks.of_rows(encounters, cases, last[slots], rows, self._world.channels))

    def _take_scores(self, tracks: Tracks) -> None:
        encounters = self._world.encounters
        for name, values in score(tracks, self._rules, encounters.log).items():
            column = self._columns.setdefault(name, np.empty(len(encounters), dtype=values.dtype))
            column[tracks.case] = values
        for name, where in broken(tracks, *self._bounds).items():
            self._broken.setdefault(name, np.zeros(len(encounters), dtype=bool))[tracks.case] = where
        cycles = 0 if self._found else int(tracks.cycles.sum())
        self._effort.encounter_cycles += cycles
        self._effort.vehicle_steps += 2 * cycles

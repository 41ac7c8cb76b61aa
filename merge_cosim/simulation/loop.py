"""The co-simulation loop: ten times a second observe, estimate, decide and command, for a whole batch at once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from merge_cosim.core.encounter import NEVER, Encounters
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.core.units import DT, AnyArray, FloatArray, IntArray
from merge_cosim.merging_cars.base import MergingCar
from merge_cosim.scoring.scoring import Rules, Watch, expected_cycles, score
from merge_cosim.scoring.tracks import Recorder, Tracks
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.worlds.tiles import World

SCORED_TOGETHER = 128
"""Encounters that are over wait until so many can be scored in one go; their tracks then still fit the cache."""


@dataclass
class Effort:
    """What a batch cost.

    Attributes:
        vehicle_steps: Vehicles times steps of running encounters.
        encounter_cycles: Cycles of running encounters.
        wall_s: Time in the loop [s].
        step_s: Of it, inside SUMO's steps [s].
        method_s: Of it, in estimating and controlling [s].
        scene_s: Simulated time of scenes [s].
        worst_difference_m: Largest difference of the world's stations from the closed form, at an encounter's end [m].
    """

    vehicle_steps: int = 0
    encounter_cycles: int = 0
    wall_s: float = 0.0
    step_s: float = 0.0
    method_s: float = 0.0
    scene_s: float = 0.0
    worst_difference_m: float = 0.0

    def add(self, other: Effort) -> None:
        """Sum two batches."""
        self.vehicle_steps += other.vehicle_steps
        self.encounter_cycles += other.encounter_cycles
        self.wall_s += other.wall_s
        self.step_s += other.step_s
        self.method_s += other.method_s
        self.scene_s += other.scene_s
        self.worst_difference_m = max(self.worst_difference_m, other.worst_difference_m)


@dataclass
class Run:
    """What came out of a batch of n encounters.

    Attributes:
        columns: All measures of `score`, and `sumo_collision`; shape (n,) each.
        effort: What it cost.
        traces: For each traced case, cycle by cycle: `host_station`, `log_odds`, ...
    """

    columns: dict[str, AnyArray]
    effort: Effort
    traces: dict[int, dict[str, list[float]]] = field(default_factory=dict)


def simulate(
    world: World,
    encounters: Encounters,
    driver: HostDriver,
    merging_car: MergingCar,
    rules: Rules,
    setting: Setting,
    traced: Sequence[int] = (),
    seed: int = 0,
) -> Run:
    """Run all encounters, `world.count` at a time, each until it is scored, fails or times out.

    Nothing that a case goes through depends on its tile or on its neighbours, so the outcome of a case is the same
    whatever the batch and the number of tiles.

    Args:
        world: What moves the cars.
        encounters: The n cases.
        driver: The host's method.
        merging_car: How the merging cars drive.
        rules: When a case is scored.
        setting: Speed limit and cycle.
        traced: Indices of the cases to record cycle by cycle.
        seed: Seed of the random streams, one per case.
    """
    return _Loop(world, encounters, driver, merging_car, rules, setting, frozenset(traced), seed).run()


class _Loop:
    def __init__(
        self,
        world: World,
        encounters: Encounters,
        driver: HostDriver,
        merging_car: MergingCar,
        rules: Rules,
        setting: Setting,
        traced: frozenset[int],
        seed: int,
    ) -> None:
        count, n = world.count, len(encounters)
        self.world, self.encounters, self.driver, self.merging_car = world, encounters, driver, merging_car
        self.rules, self.setting, self.traced = rules, setting, traced
        self.recorder = Recorder(count, rules.time_out_cycles)
        self.watch = Watch(count, rules)
        self.closed_form = np.zeros((2, count))
        self.effort = Effort()
        self.traces: dict[int, dict[str, list[float]]] = {case: defaultdict(list) for case in traced}
        driver.start(count, setting)
        merging_car.start(encounters, count, setting)
        self.keys = stream_keys(encounters.case, seed)
        self.case = np.full(count, -1)
        self.age = np.zeros(count, dtype=np.int64)
        self.score_until = np.full(n, NEVER) if encounters.log is None else encounters.log.score_until
        self.speeds = np.zeros((2, count))
        self.queue = np.argsort(-expected_cycles(encounters, rules), kind="stable")  # so that all tiles end together
        self.over: dict[int, FloatArray] = {}
        self.columns: dict[str, AnyArray] = {"sumo_collision": np.zeros(n, dtype=bool)}

    def run(self) -> Run:
        begin, stepped = perf_counter(), self.world.step_s
        self._refill(np.arange(self.world.count))
        while np.count_nonzero(self.active):
            self._cycle()
        self._score()
        self.effort.wall_s = perf_counter() - begin
        self.effort.step_s = self.world.step_s - stepped
        return Run(self.columns, self.effort, {case: dict(trace) for case, trace in self.traces.items()})

    def _cycle(self) -> None:
        begin = perf_counter()
        now = self.recorder.seen
        observed = self.merging_car.observed_speed(self.age, now.merging_speed)
        seen = now if observed is now.merging_speed else replace(now, merging_speed=observed)
        log_odds, acceleration = self.driver.decide(seen)
        np.maximum(now.host_speed + acceleration * self.setting.dt, 0.0, out=self.speeds[0])
        decided = perf_counter()
        self.speeds[1] = self.merging_car.next_speed(self.age, now)
        self.speeds *= self.active
        self.recorder.believed(log_odds)
        if self.traced:
            self._trace(now, log_odds, self.speeds[0])
        self.world.advance(self.speeds)
        self.closed_form += self.speeds * DT
        self.recorder.moved(self.world.state)
        self.age += 1
        self.effort.method_s += decided - begin
        rows = np.flatnonzero(self.active & self.watch.over(self.age, self.recorder.seen))
        if len(rows):
            self._finish(rows)
            self._refill(rows)

    def _refill(self, rows: IntArray) -> None:
        cases, self.queue = self.queue[: len(rows)], self.queue[len(rows) :]
        self.case[rows[len(cases) :]] = -1
        rows = rows[: len(cases)]
        self.case[rows], self.age[rows] = cases, 0
        self.active = self.case >= 0
        if not len(rows):
            return
        self.world.place(rows, self.encounters, cases)
        start = self.encounters.start[:, cases]
        self.closed_form[:, rows] = start[:2]
        self.recorder.placed(rows, start)
        self.merging_car.reset(rows, cases)
        self.driver.reset(rows, self.encounters.label[cases], self.keys[cases])
        self.watch.reset(rows, self.score_until[cases])

    def _finish(self, rows: IntArray) -> None:
        cases = self.case[rows]
        apart = np.abs(self.world.state[:2, rows] - self.closed_form[:, rows]).max()  # what came between them stays
        self.effort.worst_difference_m = max(self.effort.worst_difference_m, float(apart))
        self.columns["sumo_collision"][cases] = self.world.collided[rows]
        for case, row, cycles in zip(cases.tolist(), rows.tolist(), self.age[rows].tolist(), strict=True):
            self.over[case] = self.recorder.track(row, cycles)
        if len(self.over) >= SCORED_TOGETHER:
            self._score()

    def _score(self) -> None:
        """Score the encounters that are over and forget their tracks."""
        if not self.over:
            return
        tracks = Tracks.of(self.encounters, list(self.over), list(self.over.values()))
        self.over.clear()
        for name, values in score(tracks, self.rules, self.encounters.log).items():
            column = self.columns.setdefault(name, np.empty(len(self.encounters), dtype=values.dtype))
            column[tracks.case] = values
        cycles = int(tracks.cycles.sum())
        self.effort.encounter_cycles += cycles
        self.effort.vehicle_steps += 2 * cycles

    def _trace(self, now: Observation, log_odds: FloatArray, next_speed: FloatArray) -> None:
        for row in np.flatnonzero(np.isin(self.case, list(self.traced))).tolist():
            trace = self.traces[int(self.case[row])]
            for name, value in (
                ("time_s", round(self.age[row] * self.setting.dt, 9)),
                ("host_station_m", now.host_station[row]),
                ("host_speed_m_s", now.host_speed[row]),
                ("host_acceleration_m_s2", (next_speed[row] - now.host_speed[row]) / self.setting.dt),
                ("merging_station_m", now.merging_station[row]),
                ("merging_speed_m_s", now.merging_speed[row]),
                ("log_odds", log_odds[row]),
                ("not_yield", log_odds[row] >= 0.0),
            ):
                trace[name].append(float(value))

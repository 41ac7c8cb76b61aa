"""The simulation's loop with hosts that are driven from outside, and encounters without end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.errors import UserError
from merge_cosim.core.features import features
from merge_cosim.core.observation import Observation
from merge_cosim.core.units import DT, AnyArray, BoolArray, FloatArray, IntArray
from merge_cosim.estimators.references import AlwaysGo
from merge_cosim.gym.settings import ActionKind, Options
from merge_cosim.results.rows import result_rows
from merge_cosim.scoring.scoring import score
from merge_cosim.scoring.tracks import Tracks
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Effort, Loop, Run
from merge_cosim.simulation.worlds.base import Ended, GivenWorld
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.simulation.worlds.tiles import TiledWorld
from merge_cosim.sweeps.cases import PairCases


class Driven(HostDriver):
    """Hosts whose accelerations are those in `action`, shape (n,)."""

    action: FloatArray

    def __init__(self, kind: ActionKind) -> None:
        super().__init__(AlwaysGo(), Acc())
        self._decides = kind == "decision"

    def __deepcopy__(self, memo: dict[int, Any]) -> Driven:
        """The loop drives a copy of its method, and this one is driven from outside."""
        return self

    def decide(self, seen: Observation, around: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """See `HostDriver`; who yields believes that the merging car does not, and without a decision there is NaN."""
        if not self._decides:
            return np.full_like(self.action, np.nan), self.action
        log_odds = np.where(self.action != 0, np.inf, -np.inf)
        target = np.where(seen.merging_in_lane, seen.merging_ahead, log_odds > 0.0)
        return log_odds, self.controller.command(seen, log_odds, target)


@dataclass(frozen=True)
class Over:
    """Encounters that ended in a step; m of them.

    Attributes:
        slots: Where, shape (m,).
        failed: The bodies overlapped, shape (m,).
        terminated: Failed, or scored to the end; the others were truncated. Shape (m,).
        features: What could be observed last, shape (features, m).
        info: What is known of them, by name, a list of m each: `case`, `failed`, and where measures are wanted all
            columns of the rows of a sweep.
    """

    slots: IntArray
    failed: BoolArray
    terminated: BoolArray
    features: FloatArray
    info: dict[str, list[Any]]


class Episodes(Loop):
    """A loop whose steps are asked for one by one.

    Attributes:
        task: Scenario, encounters and setting.
        host: The path that the host comes by.
        over: The encounters that ended in the last step; None without any.
    """

    over: Over | None = None

    def __init__(self, options: Options, slots: int, measures: bool, endless: bool) -> None:
        """Load the encounters.

        Args:
            options: The options.
            slots: Encounters side by side.
            measures: Make rows of what ends.
            endless: A slot that becomes free takes another encounter in the same step.
        """
        self.task = task = options.task()
        self._names, self._measures, self._endless = tuple(options.observation), measures, endless
        self._hosts, self._reward = Driven(options.action), options.weights
        cases = task.cases
        assert isinstance(cases, PairCases)
        self.host = cases.host
        self._pairs: GivenWorld = (
            ClosedFormWorld(slots)
            if cases.world == "closed-form"
            else TiledWorld(task.ramp, slots, task.seed, host=cases.host)
        )
        car, rules = task.scenario.merging_car(), task.scenario.test
        super().__init__(self._pairs, cases.encounters, self._hosts, car, rules, task.setting, seed=task.seed)

    def find(self, cases: Sequence[str] | Sequence[int] | AnyArray) -> IntArray:
        """Numbers of encounters that are given by name or number.

        Raises:
            UserError: There is no such encounter.
        """
        known = self.task.cases
        numbers = np.array([known.find(case) if isinstance(case, str) else case for case in cases], dtype=np.int64)
        if ((numbers < 0) | (numbers >= len(known))).any():
            raise UserError(f"cases: the numbers of scenario {self.task.scenario.name} are 0 to {len(known) - 1}")
        return numbers

    def restart(self, cases: IntArray, random: np.random.Generator) -> FloatArray:
        """Begin encounters in all slots; returns the features, shape (features, slots).

        Args:
            cases: Their numbers, shape (slots,).
            random: Chooses those that follow.
        """
        self._random, self.over = random, None
        self._pairs.restart()
        self._pairs.line_up(cases)
        self._begin()
        return self.features

    def advance(self, action: AnyArray) -> tuple[FloatArray, FloatArray]:
        """Drive one step; returns the features, shape (features, slots), and the rewards, shape (slots,).

        Args:
            action: Accelerations [m/s^2], or 1 to yield and 0 to go, shape (slots,).

        Raises:
            UserError: There is NaN in it.
        """
        if np.isnan(action).any():
            raise UserError("action: it holds NaN")
        self._hosts.action, self.over = action, None
        before = self._recorder.seen.host_speed
        self.before_step()
        self._world.step()
        speed = self._speeds[0]
        reward = self._reward.of(speed, before, self._setting.speed_limit)
        self.after_step()
        if self.over is not None:
            reward[self.over.slots] -= self._reward.overlap * self.over.failed
        return self.features, reward

    @property
    def features(self) -> FloatArray:
        """What can be observed now, shape (features, slots)."""
        return features(self._observed, self._names)

    @property
    def _observed(self) -> Observation:
        now = self._recorder.seen
        return replace(now, merging_speed=self._merging_car.observed_speed(self._age, now.merging_speed))

    @property
    def state(self) -> FloatArray:
        """Stations and speeds of host and merging car [m, m/s] and their lengths [m], shape (6, slots)."""
        now = self._recorder.seen
        states = now.host_station, now.merging_station, now.host_speed, now.merging_speed
        return np.array([*states, now.host_length, now.merging_length])

    @property
    def time(self) -> FloatArray:
        """Time since each encounter began [s], shape (slots,)."""
        return self._age.astype(np.float64) * DT

    @property
    def bounds(self) -> tuple[float, float]:
        """The hardest braking and acceleration of the scenario's free driving [m/s^2]."""
        free = self._rules.free
        return free.min_acceleration, free.max_acceleration

    def close(self) -> None:
        """End the world."""
        self._world.close()

    def _finish(self, ended: Ended) -> None:
        """Score what has ended, and let others begin."""
        slots, cases = ended.slots, ended.cases
        encounters = self._world.encounters.take(cases)
        tracks = [self._recorder.track(slot, int(self._age[slot])) for slot in slots.tolist()]
        columns = score(Tracks.of(encounters, range(len(cases)), tracks), self._rules, encounters.log)
        failed = columns["kind"] > 0
        info: dict[str, list[Any]] = {"case": encounters.case.tolist(), "failed": failed.tolist()}
        if self._measures:
            columns["sumo_collision"] = self._pairs.collided[slots]
            run = Run(encounters, columns, Effort(), self._world.kind)
            free = self._rules.free
            info = result_rows(run, encounters, self._setting, free, self.task.names).to_pydict()
        last = features(self._observed.take(slots), self._names)
        self.over = Over(slots, failed, failed | columns["scored_to_end"], last, info)
        self._active[slots] = self._open[slots] = False
        following = self._random.integers(len(self._world.encounters), size=len(slots) if self._endless else 0)
        self._pairs.line_up(following)

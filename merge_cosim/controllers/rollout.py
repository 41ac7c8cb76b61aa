"""A planner that rolls policies out against drivers who react to them, and keeps an escape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import controllers
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.registry import parameters
from merge_cosim.core.units import Acceleration, BoolArray, Count, FloatArray, IntArray, Share
from merge_cosim.estimators.base import Estimator
from merge_cosim.estimators.driver_types import DRIVER_TYPES, ReactingDriver
from merge_cosim.estimators.interactive import Interactive

STATE = ("host_station", "host_speed", "merging_station", "merging_speed", "host_length", "merging_length")
"""Rows of the state that the compiled loops take, all of an `Observation`."""
_FREE, _COAST, _FOLLOW, _BEHIND, _HELD, _SUDDEN = range(6)
_POLICIES = (
    ("free", _FREE, 0.0),
    ("coast", _COAST, 0.0),
    ("follow", _FOLLOW, 0.0),
    ("behind", _BEHIND, 0.0),
    ("brake 1", _HELD, -1.0),
    ("brake 2", _HELD, -2.0),
    ("brake 4", _SUDDEN, -4.0),
    ("accelerate 1", _HELD, 1.0),
    ("accelerate 2", _SUDDEN, 2.0),
)
POLICIES = tuple(name for name, _, _ in _POLICIES)
"""The policies, in the order of the costs: free driving; the present speed; following the merging car as if it were in
the lane; arriving behind it; an acceleration [m/s^2] that is held, the hardest two without a bound on the jerk."""
_LEVELS = 8
"""Accelerations tried between the wanted one and an escape's."""
_ESCAPE_TIME = 20.0
"""Time [s] within which an escape must have ended."""


@controllers.register
@dataclass(kw_only=True)
class Rollout(ReactingDriver, Acc):
    """Expected cost of closed-loop policies over types of drivers that react, with commitment and an escape.

    Each cycle, each policy of `POLICIES` is driven for `steps * step` seconds against each type of driver
    (`ReactingDriver`), which plans anew in every step for where the rolled-out host is. The policy with the least
    expected cost

    `J(pi) = sum_D b(D) [overlap P(overlap) + progress t_goal + effort int a_brake^2 dt + sudden]`

    is driven, the last term for the two policies without a bound on the jerk; `t_goal` is the time at which the host is
    `goal` past the merging point (or past where it is, if beyond).
    `P(overlap) = max_t Phi(-gap(t) / (spread + spread_rate t))` over the steps with both cars past the merging point,
    by the logistic function, for a gap predicted further ahead is less sure. The policy of the cycle before is kept
    unless another is cheaper by `commitment`. The command changes by at most `max_jerk * dt` a cycle, but for the two
    hardest policies and for escapes.

    An escape is full braking or full acceleration that avoids an overlap whatever a driver within bounds does. The risk
    is the probability of an overlap under the chosen policy, or what is left of an earlier one: it falls by `exp(-dt /
    risk_memory)` a cycle at most. Where it is `tolerated_risk` or more, the command is the nearest one that leaves an
    escape for the next cycle. Where none exists within the bounds `-escape_braking` to `escape_acceleration`, they
    are narrowed in `escape_grades` steps around what the driver is expected to do now, until one does; where none does
    even so, the policy is chosen with the cost `last_overlap` of an overlap. A driver who stands at the merging point
    beside the host is taken to wait until the host has passed. With `tolerated_risk=0` it is not, and an escape from
    the full bounds is never given up.

    Where the merging car is beside the host lane and may come in anywhere up to the end of its own, as in living
    traffic, each policy is rolled out against a driver who comes in where there is room (`compiled.beside`), and the
    host keeps distance to its leader. The cost is

    `J(pi) = progress t_goal + courtesy t_driver + effort int a_brake^2 dt + sudden`

    with the times at which host and driver are `goal` past the end of the driver's lane. No overlap is expected of a
    driver who looks, so no escape is asked for.

    Once the merging car is in the lane the law of acc drives. Beliefs, margins, reaction and the merging car's state
    are those of the estimator `interactive`; where that finds a sensor to be noisy, the deviations of station and speed
    are added to `spread` and `spread_rate`, and an escape must hold for states up to `escape_deviations` of them off,
    and for a car that is further on by what it drives in the estimator's `unknown_age`. Of another's `P(N)`,
    `ignore_share` goes to `ignore`, `P(N)` of the rest to `not_yield`, what is left to `yield`, or to `wait` where the
    merging car is slower than `standing`.

    Attributes:
        behind_margin: Time behind the merging car's present arrival that the policy `behind` aims at [s].
        steps: Number of steps rolled out.
        step: Length of a step [s].
        goal: Way past the merging point at which progress is measured [m].
        scored: Time during which gaps count from when both cars have reached the merging point [s].
        overlap: Cost of an overlap [s].
        spread: Standard deviation of a predicted gap at once [m].
        spread_rate: What it grows by [m/s].
        progress: Cost of a second.
        effort: Cost of braking [s^3/m^2].
        sudden: Cost of a policy without a bound on the jerk [s].
        courtesy: Cost of a second that a driver beside the lane takes.
        end_braking: Braking at which a driver beside the lane begins to stop at the end of its own [m/s^2].
        reacts: Drivers plan anew in each step; if not (an ablation), they keep their first plan to the merging point.
        commitment: How much cheaper another policy must be to be taken.
        max_jerk: Largest change of the command but for an escape [m/s^3].
        escape: Keep an escape.
        tolerated_risk: Least risk of an overlap for which an escape is kept; 0: always.
        risk_memory: Time constant with which a risk is forgotten [s], for a belief that has just changed may again.
        escape_braking: A driver's hardest braking as the escape allows for [m/s^2].
        escape_acceleration: A driver's hardest acceleration as the escape allows for [m/s^2].
        follower_braking: Braking that a driver behind the host is sure to have [m/s^2].
        follower_reaction: Time after which it brakes [s].
        escape_grades: Steps in which the driver's bounds are narrowed to 0, until there is an escape.
        escape_deviations: Standard deviations by which the merging car's station and speed may be off in an escape.
        last_overlap: Cost of an overlap where there is no escape [s].
        least_belief: Types with less belief are not rolled out.
        ignore_share: Belief in `ignore` where the estimator has log-odds only.
        standing: Speed below which a merging car may be waiting for the host [m/s].
    """

    name: ClassVar[str] = "rollout"
    default_estimator: ClassVar[str] = "interactive"
    behind_margin: NonNegativeFloat = 1.2
    steps: Count = 32
    step: PositiveFloat = 0.25
    goal: PositiveFloat = 50.0
    scored: PositiveFloat = 3.0
    overlap: NonNegativeFloat = 7.0
    spread: PositiveFloat = 0.5
    spread_rate: NonNegativeFloat = 0.5
    progress: NonNegativeFloat = 1.0
    effort: NonNegativeFloat = 0.1
    sudden: NonNegativeFloat = 0.1
    courtesy: NonNegativeFloat = 1.0
    end_braking: PositiveFloat = 3.0
    reacts: bool = True
    commitment: NonNegativeFloat = 0.5
    max_jerk: PositiveFloat = 4.0
    escape: bool = True
    tolerated_risk: Share = 0.03
    risk_memory: NonNegativeFloat = 0.3
    escape_braking: NonNegativeFloat = 4.0
    escape_acceleration: Acceleration = 3.0
    follower_braking: PositiveFloat = 3.0
    follower_reaction: NonNegativeFloat = 0.3
    escape_grades: Count = 8
    escape_deviations: NonNegativeFloat = 2.0
    last_overlap: NonNegativeFloat = 1000.0
    least_belief: Share = 0.001
    ignore_share: Annotated[float, Field(ge=0, lt=1)] = 0.2
    standing: NonNegativeFloat = 1.0

    def taken_from(self, estimator: Estimator) -> dict[str, Any]:
        """The drivers of an estimator that has the same kinds."""
        if not isinstance(estimator, ReactingDriver):
            return {}
        return {name: getattr(estimator, name) for name in parameters(ReactingDriver)}

    def pair(self, estimator: Estimator) -> None:
        """Take beliefs from an estimator that has them."""
        self._paired = estimator if isinstance(estimator, Interactive) else None

    @property
    def _filter(self) -> Interactive | None:
        """The estimator that has beliefs; None for another, or without one."""
        return vars(self).get("_paired")

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the last commands and policies."""
        from merge_cosim.controllers.compiled.escapes import Bounds
        from merge_cosim.controllers.compiled.policies import HostLaw

        super().start(count, setting)
        self._driver_law = self.law(setting)
        self._host_law = HostLaw(
            self.k_free,
            self.k_gap,
            self.k_speed,
            self.d0,
            self.headway,
            self.min_acceleration,
            self.max_acceleration,
            self.behind_margin,
            self.max_jerk,
            self.steps,
            self.step,
            self.goal,
            self.scored,
            self.overlap,
            self.spread,
            self.spread_rate,
            self.progress,
            self.effort,
            self.sudden,
            self.courtesy,
            self.end_braking,
            self.reacts,
        )
        self._bounds = Bounds(
            self.min_acceleration,
            self.max_acceleration,
            self.escape_braking,
            self.escape_acceleration,
            self.driver_d0 if self.tolerated_risk else -np.inf,
            self.escape_deviations,
            self.follower_braking,
            self.follower_reaction,
            setting.speed_limit,
            setting.dt,
            round(_ESCAPE_TIME / setting.dt),
        )
        self._kinds = np.array([kind for _, kind, _ in _POLICIES])
        self._held = np.array([held for _, _, held in _POLICIES])
        self._traits = np.tile([self.driver_margin, self.driver_margin, 0.0, 0.0, 0.0, 0.0], (count, 1))
        self._delays = np.zeros(count)
        self._around = np.tile([[np.inf], [0.0], [0.0]], count)
        self._offered = np.zeros(count)
        self._last = np.full(count, np.nan)
        self.last_policy = np.full(count, -1)
        self.last_belief = np.zeros((count, len(DRIVER_TYPES)))
        self.risk, self._recent_risk = np.zeros((2, count))
        self._risk_kept = float(np.exp(-setting.dt / max(self.risk_memory, 1e-9)))
        self._plans = np.zeros(count, dtype=bool)
        self.escape_status = np.zeros(count, dtype=np.int64)
        self._centre, self._in_lane = np.zeros((2, count))
        self._shares = np.arange(self.escape_grades, 0, -1) / self.escape_grades

    def reset(self, rows: IntArray) -> None:
        """Forget the last commands and policies at `rows`."""
        self._last[rows] = np.nan
        self._recent_risk[rows] = 0.0
        self.last_policy[rows] = -1
        self._offered[rows] = 0.0
        self._in_lane[rows] = 0.0

    def look_around(self, around: FloatArray) -> None:
        """See `Controller`."""
        self._around = around

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """The cheapest policy's acceleration, with commitment, bounded jerk and an escape."""
        from merge_cosim.controllers.compiled.beside import note_room
        from merge_cosim.controllers.compiled.escapes import NONE, constrain
        from merge_cosim.controllers.compiled.rollouts import choose

        deviation, late = np.zeros((2, len(target))), np.zeros(len(target))
        if self._filter is not None:
            seen, deviation, late = self._filter.observed(seen), self._filter.deviation[:2], self._filter.late
            target = np.where(seen.merging_in_lane, seen.merging_ahead, log_odds >= 0.0)
        wanted = super().command(seen, log_odds, target)
        gap, leader_speed, room = self._around
        beside = room > 0.0
        lead = np.where(beside, seen.host_station + gap, np.inf)
        state = np.stack([*(getattr(seen, name) for name in STATE), *deviation, late, room, lead, leader_speed])
        self._plans = plans = ~seen.merging_in_lane
        self.last_belief = self._belief(seen, log_odds)
        traits, delays = self._traits, self._delays
        if self._filter is not None:
            traits, delays = self._filter.traits, self._filter.unreacted * self._filter.reaction_time
        if np.count_nonzero(beside):
            waits = np.arange(len(DRIVER_TYPES)) == DRIVER_TYPES.index("wait")
            self.last_belief = np.where(beside[:, None], waits, self.last_belief)
            note_room(state, self._offered, self.setting.dt, self._host_law)
            delays = np.where(beside, self._offered, delays)
        self._seen = state, self.last_belief, traits, delays, self._last
        rest = (
            self.last_belief,
            traits,
            delays,
            self._kinds,
            self._held,
            self._last,
            self.least_belief,
            self.commitment,
        )
        filled = self._driver_law, self.last_policy, self.risk, self._centre, wanted
        choose(state, plans, *rest, self._host_law, *filled)
        command = self._smooth(wanted, plans)
        self._guard = self._shares, self._centre, self._in_lane
        self._in_lane = np.where(plans, 0.0, self._in_lane + self.setting.dt)
        if self.escape:
            self._recent_risk = np.maximum(self.risk, self._recent_risk * self._risk_kept)
            guarded = ~plans | (self._recent_risk >= self.tolerated_risk)
            constrain(state, guarded, *self._guard, _LEVELS, self._bounds, command, self.escape_status)
            lost = plans & (self.escape_status == NONE)
            if np.count_nonzero(lost):
                choose(state, lost, *rest, self._host_law._replace(overlap=self.last_overlap), *filled)
                command = np.where(lost, wanted, command)
        self._last = command.copy()
        return command

    @property
    def last_costs(self) -> FloatArray:
        """Cost of every policy against every type in the last cycle, shape (n, policies, types)."""
        from merge_cosim.controllers.compiled.rollouts import cost_table

        state, belief, traits, delays, last = self._seen
        costs = np.empty((len(belief), len(POLICIES), len(DRIVER_TYPES)))
        rest = self.least_belief, self._host_law, self._driver_law, costs
        cost_table(state, belief, traits, delays, self._kinds, self._held, last, *rest)
        return costs

    def _smooth(self, wanted: FloatArray, plans: BoolArray) -> FloatArray:
        change = self.max_jerk * self.setting.dt
        smooth = np.minimum(np.maximum(wanted, self._last - change), self._last + change)
        free_to_change = np.isnan(self._last) | ~plans | (self._kinds[self.last_policy] == _SUDDEN)
        return np.where(free_to_change, wanted, smooth)

    @property
    def escape_share(self) -> FloatArray:
        """The largest share of the driver's bounds within which there was an escape in the last cycle, shape (n,)."""
        from merge_cosim.controllers.compiled.escapes import widest

        found = np.empty(len(self._centre))
        widest(self._seen[0], *self._guard, self._bounds, found)
        return found

    @property
    def channels(self) -> tuple[str, ...]:
        """The number of the chosen policy, `escape_share`, and the expected cost of each policy."""
        return ("policy", "escape_share", *(f"cost_s {name}" for name in POLICIES))

    def channel_values(self) -> FloatArray:
        """The number of the chosen policy in `POLICIES`, `escape_share`, and the expected cost of each policy [s]."""
        costs = (self.last_costs * self.last_belief[:, None]).sum(axis=2).T
        return np.where(self._plans, np.vstack([self.last_policy, self.escape_share, costs]), np.nan)

    def _belief(self, seen: Observation, log_odds: FloatArray) -> FloatArray:
        """Belief over `DRIVER_TYPES`, shape (n, types)."""
        if self._filter is not None:
            return self._filter.beliefs
        not_yield = (0.5 + 0.5 * np.tanh(0.5 * log_odds)) * (1.0 - self.ignore_share)
        yields = 1.0 - self.ignore_share - not_yield
        waits = np.where(seen.merging_speed < self.standing, yields, 0.0)
        none = np.zeros_like(yields)
        return np.stack([yields - waits, not_yield, none + self.ignore_share, waits, none, none], axis=1)

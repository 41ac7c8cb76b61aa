"""What an environment can be given: scenario, world, observation, action and reward."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from merge_cosim.core.errors import UserError
from merge_cosim.core.features import FEATURES, checked
from merge_cosim.core.units import DT, FloatArray
from merge_cosim.ngsim.data import find_data
from merge_cosim.scenarios.encounters import SourceChoice
from merge_cosim.scenarios.scenario import Scenario
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.sweeps.cases import LoggedCases, PairCases
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.task import Task

ActionKind: TypeAlias = Literal["acceleration", "decision"]
"""The host's acceleration [m/s^2], or 0 to go and 1 to yield, which the controller `acc` then drives."""
AGENT = "agent"
"""Name of the agent in the column `method`."""


@dataclass(frozen=True)
class Reward:
    """`-overlap [failed] - progress (1 - v / v_limit) dt - comfort a^2 dt`, summed over the steps of an encounter.

    Attributes:
        overlap: For a failure, once.
        progress: For each second that is lost against driving at the speed limit [1/s].
        comfort: For the square of the host's acceleration [s^3/m^2].
    """

    overlap: float = 50.0
    progress: float = 1.0
    comfort: float = 0.05

    def of(self, speed: FloatArray, before: FloatArray, limit: float) -> FloatArray:
        """The reward of one step without a failure, shape (n,).

        Args:
            speed: The hosts' speeds in the step [m/s].
            before: Their speeds before it [m/s].
            limit: Speed limit [m/s].
        """
        change = (speed - before) * (1.0 / DT)
        lost = self.progress * DT - (self.progress * DT / limit) * speed
        return -lost - (self.comfort * DT) * (change * change)


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of an environment.

    Attributes:
        scenario: Name or file of a scenario of pairs, or a scenario.
        settings: Scenario keys and their values (`test.horizon`, `merging.sigma`, ...).
        world: What moves the cars: `closed-form`, or `sumo`, of which a process holds one.
        data: Folder with NGSIM files.
        source: Force real data or the surrogate.
        observation: Names of features, see `merge_cosim.core.features`.
        action: `acceleration` or `decision`.
        reward: The reward, or some of its weights.
    """

    scenario: str | Path | Scenario = "designed-3"
    settings: Mapping[str, Any] = field(default_factory=dict)
    world: WorldKind = "closed-form"
    data: str | Path | None = None
    source: SourceChoice | None = None
    observation: Sequence[str] = FEATURES[:7]
    action: ActionKind = "acceleration"
    reward: Reward | Mapping[str, float] = Reward()

    @property
    def weights(self) -> Reward:
        """The reward.

        Raises:
            UserError: There is no such weight.
        """
        if isinstance(self.reward, Reward):
            return self.reward
        try:
            return Reward(**self.reward)
        except TypeError:
            raise UserError(
                f"reward: the weights are overlap, progress and comfort, not {', '.join(self.reward)}"
            ) from None

    def task(self) -> Task:
        """The encounters and what belongs to them, as a sweep has them.

        Raises:
            UserError: An option is wrong, or the scenario is not of pairs only.
        """
        checked(self.observation)
        if self.action not in ("acceleration", "decision"):
            raise UserError(f"action = {self.action!r}: choose 'acceleration' or 'decision'")
        scenario = self.scenario if isinstance(self.scenario, Scenario) else str(self.scenario)
        request = SweepRequest(
            scenarios=[scenario],
            methods=["acc"],
            settings=dict(self.settings),
            data=find_data(self.data),
            source=self.source,
            world=self.world,
        )
        task = plan(request)[0]
        if not isinstance(task.cases, PairCases) or isinstance(task.cases, LoggedCases):
            raise UserError(f"scenario {task.scenario.name}: an environment has one host and one merging car")
        if task.scenario.sensing:
            raise UserError(
                f"scenario {task.scenario.name}: an environment is observed without a sensor; leave out sensing"
            )
        return replace(task, method=replace(task.method, name=AGENT))

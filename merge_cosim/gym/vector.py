"""Thousands of encounters side by side in one process, as a Gymnasium vector environment."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from merge_cosim.core.units import BoolArray, FloatArray
from merge_cosim.gym.env import Observed, action_space, observation_space, observed
from merge_cosim.gym.episodes import Episodes, Over
from merge_cosim.gym.settings import Options


class MergeVectorEnv(VectorEnv[Observed, Any, Any]):
    """`MergeEnv` many times over: arrays instead of processes.

    An encounter that ends is followed by another one in the same step. What was observed last and its `info` are in
    `final_obs` and `final_info` of the step's `info`, as Gymnasium has them.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # type: ignore[misc]

    def __init__(self, num_envs: int = 1, *, measures: bool = False, render_mode: None = None, **options: Any) -> None:
        """Load the encounters.

        Args:
            num_envs: Encounters side by side.
            measures: `final_info` holds the rows of a sweep, not only `case` and `failed`.
            render_mode: None.
            options: See `merge_cosim.gym.settings.Options`.

        Raises:
            UserError: An option is wrong.
        """
        chosen = Options(**options)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.episodes = Episodes(chosen, num_envs, measures=measures, endless=True)
        self.single_observation_space = observation_space(chosen)
        self.single_action_space = action_space(chosen, self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin encounters everywhere: random ones, or `options["cases"]`, names or numbers, shape (num_envs,)."""
        super().reset(seed=seed)
        episodes, chosen = self.episodes, (options or {}).get("cases")
        random = self.np_random.integers(len(episodes.task), size=self.num_envs)
        return observed(episodes.restart(random if chosen is None else episodes.find(chosen), self.np_random)), {}

    def step(self, actions: Any) -> tuple[Observed, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Drive one cycle."""
        action = np.asarray(actions, dtype=np.float64).reshape(self.num_envs)
        features, reward = self.episodes.advance(action)
        terminated, truncated = np.zeros((2, self.num_envs), dtype=bool)
        info: dict[str, Any] = {}
        over = self.episodes.over
        if over is not None:
            terminated[over.slots], truncated[over.slots] = over.terminated, ~over.terminated
            info = self._final(over)
        return observed(features), reward, terminated, truncated, info

    def close_extras(self, **kwargs: Any) -> None:
        """End the world."""
        self.episodes.close()

    def _final(self, over: Over) -> dict[str, Any]:
        """`final_obs`, `final_info` and the masks that say where they hold something."""
        ended = np.zeros(self.num_envs, dtype=bool)
        ended[over.slots] = True
        last = np.full(self.num_envs, None, dtype=object)
        for slot, row in zip(over.slots.tolist(), observed(over.features), strict=True):
            last[slot] = row
        final: dict[str, Any] = {}
        for name, values in over.info.items():
            kind = bool if name == "failed" else object
            final[name] = np.zeros(self.num_envs, dtype=kind) if kind is bool else np.full(self.num_envs, None)
            final[name][over.slots] = values
            final[f"_{name}"] = ended
        return {"final_obs": last, "_final_obs": ended, "final_info": final, "_final_info": ended}

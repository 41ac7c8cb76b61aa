"""One encounter at a time, as a Gymnasium environment."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from merge_cosim.core.features import lower_bounds
from merge_cosim.core.units import FloatArray
from merge_cosim.gym.drawing import FPS, Drawing
from merge_cosim.gym.episodes import Episodes
from merge_cosim.gym.settings import Options

Observed = NDArray[np.float32]


def observation_space(options: Options) -> spaces.Box[np.float32]:
    """The features that were chosen."""
    low = lower_bounds(options.observation).astype(np.float32)
    return spaces.Box(low, np.full_like(low, np.inf), dtype=np.float32)


def action_space(options: Options, episodes: Episodes) -> spaces.Space[Any]:
    """An acceleration within the bounds of the scenario's free driving [m/s^2], or 0 to go and 1 to yield."""
    if options.action == "decision":
        return spaces.Discrete(2)
    low, high = episodes.bounds
    return spaces.Box(low, high, (1,), np.float32)


def observed(features: FloatArray) -> Observed:
    """Features as Gymnasium has them, from shape (features, n) to (n, features)."""
    return np.ascontiguousarray(features.T, dtype=np.float32)


class MergeEnv(gymnasium.Env[Observed, Any]):
    """One host, driven by the agent, and one merging car; a step is a cycle of 0.1 s.

    An episode terminates with a failure (the bodies overlap once both cars are past the merging point) or when it has
    been scored to the end, and is truncated when its time is out or its log ends. `info` holds `case` from a reset
    on, and the row of a sweep at the end.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": FPS}  # type: ignore[misc]

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        """Load the encounters.

        Args:
            render_mode: None or `rgb_array`.
            options: See `merge_cosim.gym.settings.Options`.

        Raises:
            UserError: An option is wrong.
        """
        chosen = Options(**options)
        self.render_mode = render_mode
        self.episodes = Episodes(chosen, 1, measures=True, endless=False)
        self.observation_space = observation_space(chosen)
        self.action_space = action_space(chosen, self.episodes)
        self._drawing: Drawing | None = None
        self._running = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an encounter: one at random, or `options["case"]`, its name or number."""
        super().reset(seed=seed)
        episodes, chosen = self.episodes, (options or {}).get("case")
        case = self.np_random.integers(len(episodes.task), size=1) if chosen is None else episodes.find([chosen])
        features = episodes.restart(case, self.np_random)
        self._running = True
        return observed(features)[0], {"case": episodes.task.case(int(case[0]))}

    def step(self, action: Any) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Drive one cycle."""
        if not self._running:
            raise ResetNeeded("Cannot call env.step() before calling env.reset()")
        features, reward = self.episodes.advance(np.asarray(action, dtype=np.float64).reshape(1))
        over = self.episodes.over
        if over is None:
            return observed(features)[0], float(reward[0]), False, False, {}
        self._running = False
        terminated = bool(over.terminated[0])
        info = {name: values[0] for name, values in over.info.items()}
        return observed(over.features)[0], float(reward[0]), terminated, not terminated, info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture of both cars, shape (height, width, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        if self._drawing is None:
            self._drawing = Drawing(self.episodes.host)
        return self._drawing.frame(self.episodes.state[:, 0], float(self.episodes.time[0]))

    def close(self) -> None:
        """End the world."""
        self.episodes.close()

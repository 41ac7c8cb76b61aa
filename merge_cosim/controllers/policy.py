"""A learned policy: a small neural network from features of the observation to the host's acceleration."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from merge_cosim.controllers.base import Controller
from merge_cosim.core.errors import UserError
from merge_cosim.core.features import checked, features
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import BoolArray, FloatArray

BOUNDS = (-4.0, 2.0)
"""Bounds of the acceleration [m/s^2], those of the environment's action."""


@dataclass(kw_only=True)
class Policy(Controller):
    """Commands what a network says, `policy:FILE` as a method: layers of `tanh(W x + b)`, the last one without tanh.

    Attributes:
        file: JSON file with the weights, see `save_policy`.
    """

    name: ClassVar[str] = "policy"
    file: str

    def start(self, count: int, setting: Setting) -> None:
        """Read the file.

        Raises:
            UserError: It is not there, or damaged.
        """
        super().start(count, setting)
        try:
            held = json.loads(Path(self.file).read_text(encoding="utf-8"))
            self._names = checked(held["observation"])
            self._mean, self._scale = (np.array(held[key], dtype=np.float64) for key in ("mean", "scale"))
            self._layers = [tuple(np.array(part, dtype=np.float64) for part in layer) for layer in held["layers"]]
            shapes = [len(self._names), *(len(bias) for _, bias in self._layers)]
            fits = [weights.shape == (shapes[n + 1], shapes[n]) for n, (weights, _) in enumerate(self._layers)]
            numbers = [self._mean, self._scale, *(part for layer in self._layers for part in layer)]
            if not all(fits) or shapes[-1] != 1 or not all(np.isfinite(part).all() for part in numbers):
                raise ValueError("the layers do not fit each other, or a weight is no finite number")
            if len(self._mean) != shapes[0] or len(self._scale) != shapes[0] or not (self._scale > 0).all():
                raise ValueError("mean and scale need one number per feature, those of scale above 0")
        except OSError as error:
            raise UserError(f"{self.file}: cannot be read: {error.strerror}") from None
        except (ValueError, KeyError, TypeError, UserError) as error:
            raise UserError(f"{self.file}: not a policy: {error}") from None

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """The network's output, within the bounds."""
        x = (features(seen, self._names) - self._mean[:, None]) / self._scale[:, None]
        for number, (weights, bias) in enumerate(self._layers):
            total = np.repeat(bias[:, None], x.shape[1], axis=1)
            for column, row in zip(weights.T, x, strict=True):  # a matrix product would depend on the batch's size
                total += column[:, None] * row
            x = total if number == len(self._layers) - 1 else np.tanh(total)
        return np.clip(x[0], *BOUNDS)


def save_policy(
    file: str | Path,
    observation: Sequence[str],
    layers: Sequence[tuple[Any, Any]],
    mean: Any = None,
    scale: Any = None,
) -> None:
    """Write a policy as data, to be driven by the method `policy:FILE`.

    Args:
        file: A JSON file.
        observation: Names of the features, k of them.
        layers: Weights, shape (outputs, inputs), and biases, shape (outputs,), of each layer; the last has one output,
            the acceleration [m/s^2].
        mean: Taken from each feature, shape (k,); 0 if not given.
        scale: What the difference is divided by, shape (k,); 1 if not given.
    """
    names = checked(observation)
    held = {
        "observation": names,
        "mean": np.zeros(len(names)).tolist() if mean is None else np.asarray(mean).tolist(),
        "scale": np.ones(len(names)).tolist() if scale is None else np.asarray(scale).tolist(),
        "layers": [[np.asarray(part).tolist() for part in layer] for layer in layers],
    }
    Path(file).write_text(json.dumps(held), encoding="utf-8")

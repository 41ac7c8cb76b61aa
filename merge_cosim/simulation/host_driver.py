"""A host's driver: from what is seen to the log-odds and the acceleration."""

from dataclasses import dataclass

import numpy as np

from merge_cosim.controllers.base import Controller
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.registry import Component
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.base import Estimator


@dataclass(frozen=True)
class HostDriver:
    """A method, ready to drive: an estimator and a controller."""

    estimator: Estimator
    controller: Controller

    def start(self, count: int, setting: Setting) -> None:
        """Make room for a batch of `count` encounters."""
        self.estimator.start(count, setting)
        self.controller.start(count, setting)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Forget the encounters at `rows`; see `Estimator.reset`."""
        self.estimator.reset(rows, labels, keys)
        self.controller.reset(rows)

    def decide(self, seen: Observation) -> tuple[FloatArray, FloatArray]:
        """The log-odds of NOT_YIELD and the acceleration to command [m/s^2], shape (n,) each.

        Raises:
            UserError: A component gives NaN, or an array of another shape.
        """
        log_odds = _numbers(self.estimator.update(seen), self.estimator, seen)
        target = np.where(seen.merging_in_lane, seen.merging_ahead, log_odds >= 0.0)
        acceleration = self.controller.command(seen, log_odds, target)
        return log_odds, _numbers(acceleration, self.controller, seen)


def _numbers(values: FloatArray, component: Component, seen: Observation) -> FloatArray:
    n = len(seen.host_station)
    missing = np.isnan(values)
    if missing.shape == (n,) and not np.count_nonzero(missing):  # the two cheapest questions: they are asked each cycle
        return values
    who = type(component).__name__
    if missing.shape != (n,):
        raise UserError(f"{who}: gives shape {missing.shape} where shape {(n,)} is due")
    row = int(missing.argmax())
    host, merging = (
        f"at {station[row]:.2f} m and {speed[row]:.2f} m/s"
        for station, speed in ((seen.host_station, seen.host_speed), (seen.merging_station, seen.merging_speed))
    )
    raise UserError(f"{who}: gives NaN for a host {host}, a merging car {merging}")

"""A method that drives hosts: from what is observed to the log-odds and the acceleration."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field, fields

import numpy as np

from merge_cosim.controllers.base import Controller
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.registry import Component
from merge_cosim.core.units import BoolArray, FloatArray, IntArray
from merge_cosim.estimators.base import Estimator
from merge_cosim.sensors.base import Sensor
from merge_cosim.sensors.perfect import Perfect


@dataclass(frozen=True)
class HostDriver:
    """A method, ready to drive: an estimator and a controller, and the sensor that they see through.

    All that they derive from the merging car's state, such as `Observation.merging_in_lane`, comes from the observed
    one: a host whose sensor is late or wrong takes the merging car to be in the lane when the sensor says so.
    """

    estimator: Estimator
    controller: Controller
    sensor: Sensor = field(default_factory=Perfect)

    def start(self, count: int, setting: Setting) -> None:
        """Make room for a batch of `count` encounters."""
        self.sensor.start(count, setting)
        declared = self.sensor.declared(setting)
        self.controller.pair(self.estimator)
        self.estimator.start(count, declared)
        self.controller.start(count, declared)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Forget the encounters at `rows`; see `Estimator.reset`."""
        self.sensor.reset(rows, keys)
        self.estimator.reset(rows, labels, keys)
        self.controller.reset(rows)

    def rest(self, rows: IntArray) -> None:
        """See `Estimator.rest`."""
        self.estimator.rest(rows)

    @property
    def can_thin(self) -> bool:
        """Whether all its parts can leave out encounters."""
        return self.sensor.can_thin and self.estimator.can_thin and self.controller.can_thin

    def thin(self, rows: IntArray) -> None:
        """See `Component.thin`."""
        for part in (self.sensor, self.estimator, self.controller):
            part.thin(rows)

    def decide(self, now: Observation, around: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """The log-odds of NOT_YIELD and the acceleration to command [m/s^2], shape (n,) each.

        Args:
            now: The present cycle, before the sensor.
            around: See `Controller.look_around`; None in a world without other cars.

        Raises:
            UserError: A component gives NaN, or an array of another shape.
        """
        seen = self.sensor.observe(now)
        log_odds = _numbers(self.estimator.update(seen), self.estimator, seen)
        target = log_odds >= 0.0
        np.putmask(target, seen.merging_in_lane, seen.merging_ahead)  # faster than np.where
        if around is not None:
            self.controller.look_around(around)
        acceleration = self.controller.command(seen, log_odds, target)
        return log_odds, _numbers(acceleration, self.controller, seen)


class DriverBlocks:
    """Copies of a method, each for `size` slots, so that slots can be added while it runs."""

    def __init__(self, driver: HostDriver, size: int, setting: Setting) -> None:
        self._driver, self._size, self._setting = driver, size, setting
        self._blocks: list[HostDriver] = []
        self._decided: set[int] = set()
        """Blocks that have decided in the last cycle."""

    def make_room(self, slots: int) -> None:
        """Start as many blocks as the slots need."""
        while len(self._blocks) * self._size < slots:
            block = deepcopy(self._driver)
            block.start(self._size, self._setting)
            self._blocks.append(block)

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """See `HostDriver.reset`."""
        if len(self._blocks) == 1:
            self._blocks[0].reset(rows, labels, keys)
            return
        for number, block in enumerate(self._blocks):
            own = np.flatnonzero(rows // self._size == number)
            if len(own):
                block.reset(rows[own] - number * self._size, labels[own], keys[own])

    def channel_values(self) -> FloatArray:
        """See `Controller.channel_values`; shape (channels, slots)."""
        none = np.full((len(self._driver.controller.channels), self._size), np.nan)
        return np.concatenate(
            [
                block.controller.channel_values() if number in self._decided else none
                for number, block in enumerate(self._blocks)
            ],
            axis=1,
        )

    def rest(self, rows: IntArray) -> None:
        """See `Estimator.rest`."""
        if len(self._blocks) == 1:
            self._blocks[0].rest(rows)
            return
        for number, block in enumerate(self._blocks):
            block.rest(rows[rows // self._size == number] - number * self._size)

    def thin(self, rows: IntArray) -> None:
        """See `Component.thin`; there is one block."""
        (block,) = self._blocks
        block.thin(rows)
        self._size = len(rows)

    def decide(
        self, seen: Observation, active: BoolArray, around: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """See `HostDriver.decide`; blocks without an active slot are left out, and their entries mean nothing."""
        self._decided.clear()
        if len(self._blocks) == 1 and np.count_nonzero(active):
            self._decided.add(0)
            return self._blocks[0].decide(seen, around)
        log_odds, acceleration = np.zeros((2, len(active)))
        for number, block in enumerate(self._blocks):
            own = slice(number * self._size, (number + 1) * self._size)
            if np.count_nonzero(active[own]):
                part = Observation(*(getattr(seen, one.name)[own] for one in fields(Observation)))
                log_odds[own], acceleration[own] = block.decide(part, around if around is None else around[:, own])
                self._decided.add(number)
        return log_odds, acceleration


def _numbers(values: FloatArray, component: Component, seen: Observation) -> FloatArray:
    n, who = len(seen.host_station), type(component).__name__
    try:
        missing = np.isnan(values)
    except TypeError:
        raise UserError(f"{who}: gives {values!r:.60}, where {n} numbers are due") from None
    if missing.shape == (n,) and not np.count_nonzero(missing):  # the two cheapest checks: each cycle makes them
        return values
    if missing.shape != (n,):
        raise UserError(f"{who}: gives shape {missing.shape} where shape {(n,)} is due")
    row = int(missing.argmax())
    host, merging = (
        f"at {station[row]:.2f} m and {speed[row]:.2f} m/s"
        for station, speed in ((seen.host_station, seen.host_speed), (seen.merging_station, seen.merging_speed))
    )
    raise UserError(f"{who}: gives NaN for a host {host}, a merging car {merging}")

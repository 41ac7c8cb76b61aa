"""The sensor with delay, bias, noise, quantisation and dropout."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys, derived_keys, normal, uniform
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.sensors.base import Sensor, sensors


@sensors.register
@dataclass(kw_only=True)
class Noisy(Sensor):
    """Station and speed of the merging car with errors, in this order: delay, bias, noise, quantisation, dropout.

    What a host cannot have seen because it lies before the encounter's start is the initial state, moved back at the
    initial speed. A speed below 0 is reported as 0. The first cycle of an encounter is never lost. An error whose
    parameter is 0 is left out, so the defaults observe the truth.

    Attributes:
        delay: Age of what is observed [s], in whole cycles.
        stamped: Reports carry a time stamp, so a method may know how old they are.
        compensated: The station is moved on by the delay at the observed speed, as a host can that knows the delay.
        station_bias: Added to the station [m].
        speed_bias: Added to the speed [m/s].
        station_sigma: Standard deviation of the station's noise [m].
        speed_sigma: Standard deviation of the speed's noise [m/s].
        time_constant: Time constant of first-order noise [s]; 0 for white noise.
        station_step: Stations are multiples of this [m]; 0 for any value.
        speed_step: Speeds are multiples of this [m/s]; 0 for any value.
        dropout: Share of the cycles without a measurement.
        dropout_time: Mean length of a dropout [s]; below `0.1 / (1 - dropout)` the lost cycles are independent.
        lost: What a dropout reports: `predict`, the last report moved on at its speed, or `hold`, the last report.
        seed: Seed of the errors, beside that of the sweep.
    """

    name: ClassVar[str] = "noisy"
    delay: Annotated[float, Field(ge=0, le=10)] = 0.0
    stamped: bool = True
    compensated: bool = False
    station_bias: float = 0.0
    speed_bias: float = 0.0
    station_sigma: NonNegativeFloat = 0.0
    speed_sigma: NonNegativeFloat = 0.0
    time_constant: NonNegativeFloat = 0.0
    station_step: NonNegativeFloat = 0.0
    speed_step: NonNegativeFloat = 0.0
    dropout: Annotated[float, Field(ge=0, le=0.99)] = 0.0
    dropout_time: NonNegativeFloat = 0.0
    lost: Literal["predict", "hold"] = "predict"
    seed: int = 0

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the last cycles and the errors."""
        super().start(count, setting)
        self._lag = round(self.delay / setting.dt)
        self._keep = float(np.exp(-setting.dt / self.time_constant)) if self.time_constant else 0.0
        self._cycle, self._age = 0, np.zeros(count, dtype=np.int64)
        self._ring = np.zeros((self._lag + 1, 2, count))
        self._bias = np.array([[self.station_bias], [self.speed_bias]])
        self._sigma = np.array([[self.station_sigma], [self.speed_sigma]])
        self._noise, self._report = np.zeros((2, 2, count))
        self._is_lost = np.zeros(count, dtype=bool)
        self._noise_keys, self._dropout_keys = np.zeros((2, count), dtype=np.uint64)

    def declared(self, setting: Setting) -> Setting:
        """With the delay, if reports are stamped, and whether it is compensated."""
        latency = self._lag * setting.dt if self.stamped else None
        return replace(setting, latency=latency, compensated=self.compensated)

    def reset(self, rows: IntArray, keys: Keys) -> None:
        """Begin the errors of the encounters at `rows`."""
        self._age[rows] = 0
        self._is_lost[rows] = False
        self._noise_keys[rows] = derived_keys(keys, f"sensor noise/{self.seed}")
        self._dropout_keys[rows] = derived_keys(keys, f"sensor dropout/{self.seed}")

    def observe(self, now: Observation) -> Observation:
        """The merging car's state with the errors."""
        report = self._delayed(np.array([now.merging_station, now.merging_speed])) + self._bias
        if self._sigma.any():
            report += self._errors()
        np.maximum(report[1], 0.0, out=report[1])
        for values, step in zip(report, (self.station_step, self.speed_step), strict=True):
            if step:
                np.multiply(np.round(values / step), step, out=values)
        if self.dropout:
            report = self._with_dropouts(report)
        self._age += 1
        return replace(now, merging_station=report[0], merging_speed=report[1])

    def _delayed(self, state: FloatArray) -> FloatArray:
        """Station and speed as they were `delay` ago, shape (2, n)."""
        if not self._lag:
            return state
        self._ring[self._cycle % len(self._ring)] = state
        back = np.minimum(self._age, self._lag)
        station, speed = self._ring[(self._cycle - back) % len(self._ring), :, np.arange(len(back))].T
        self._cycle += 1
        forth = back if self.compensated else back - self._lag
        return np.array([station + speed * (forth * self.setting.dt), speed])

    def _errors(self) -> FloatArray:
        """The noise of this cycle, shape (2, n); in the first one from the stationary distribution."""
        fresh = self._sigma * normal(self._noise_keys, 2 * self._age, 2).T
        if self._keep:
            kept = self._keep * self._noise + float(np.sqrt(1.0 - self._keep**2)) * fresh
            fresh = self._noise = np.where(self._age == 0, fresh, kept)
        return fresh

    def _with_dropouts(self, report: FloatArray) -> FloatArray:
        """The report, or what stands for it; lost cycles are a Markov chain with the given share and mean length."""
        length = max(self.dropout_time / self.setting.dt, 1.0 / (1.0 - self.dropout))
        begins = self.dropout / ((1.0 - self.dropout) * length)
        drawn = uniform(self._dropout_keys, self._age, 1)[:, 0]
        self._is_lost = (self._age > 0) & (drawn < np.where(self._is_lost, 1.0 - 1.0 / length, begins))
        last = self._report
        if self.lost == "predict":
            last = np.array([last[0] + last[1] * self.setting.dt, last[1]])
        self._report = np.where(self._is_lost, last, report)
        return self._report

"""What the host observes in one cycle, and the setting of a run: the input of estimators and controllers."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from merge_cosim.core.units import DT, TOLERANCE, BoolArray, FloatArray, IntArray, time_to_arrival

DECIMALS = 6
"""What is observed is rounded to 1e-6 m and m/s: the designed grid is full of ties that the last bits would break."""
_LEVEL = np.array(-TOLERANCE)
"""An array, with which numpy compares faster than with a float."""


@dataclass(frozen=True)
class Setting:
    """What is the same for every car of a run.

    Attributes:
        speed_limit: Speed limit [m/s].
        dt: Length of a cycle [s].
        latency: Age [s] of what the host observes, as the time stamps of its sensor tell; None without time stamps.
        compensated: The observed station was moved on by the latency at the observed speed.
    """

    speed_limit: float = 29.0
    dt: float = DT
    latency: float | None = 0.0
    compensated: bool = False


@dataclass(frozen=True)
class Observation:
    """One cycle of a batch of encounters, or some cycles of it laid end to end; every array has shape (n,).

    In a run the arrays are views of a record whose room is used again: copy what you keep for later cycles.

    Attributes:
        host_station, host_speed: State of the host [m, m/s].
        merging_station, merging_speed: State of the merging car as the host observes it [m, m/s].
        host_length, merging_length: Lengths [m].
    """

    host_station: FloatArray
    host_speed: FloatArray
    merging_station: FloatArray
    merging_speed: FloatArray
    host_length: FloatArray
    merging_length: FloatArray

    def take(self, rows: IntArray) -> Observation:
        """The chosen encounters, in that order."""
        return Observation(*(getattr(self, field.name)[rows] for field in fields(self)))

    @property
    def host_arrival(self) -> FloatArray:
        """The host's time to arrival T_h [s]."""
        return time_to_arrival(self.host_station, self.host_speed)

    @property
    def merging_arrival(self) -> FloatArray:
        """The merging car's time to arrival T_m [s]."""
        return time_to_arrival(self.merging_station, self.merging_speed)

    @property
    def merging_in_lane(self) -> BoolArray:
        """The merging car has reached the merging point."""
        return self.merging_station >= _LEVEL

    @property
    def merging_ahead(self) -> BoolArray:
        """The merging car's front is level with the host's or past it."""
        return self.merging_station - self.host_station >= _LEVEL

    @property
    def gap(self) -> FloatArray:
        """Bumper-to-bumper distance [m] from the car behind to the car ahead; negative where the bodies overlap."""
        ahead_by = self.merging_station - self.host_station  # taken once, `merging_ahead` would take it again
        leader_length = np.where(ahead_by >= _LEVEL, self.merging_length, self.host_length)
        return np.abs(ahead_by) - leader_length

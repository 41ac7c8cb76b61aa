"""Difference of a host to the logged host of its encounter."""

from __future__ import annotations

import numpy as np

from merge_cosim.core.encounter import ReplayLog
from merge_cosim.core.units import DT, FloatArray
from merge_cosim.scoring.tracks import Tracks


def human_difference(tracks: Tracks, log: ReplayLog | None) -> dict[str, FloatArray]:
    """Squared differences to the logged host [m^2, m^2/s^2], summed while its log lasts; zero without a log."""
    sums = {"station_square_sum": tracks.fill(0.0), "speed_square_sum": tracks.fill(0.0)}
    if log is None:
        return sums
    station = log.host_station
    speed = np.diff(station.values, prepend=0.0) / DT  # the first of each log is never read
    joint = np.flatnonzero((tracks.age > 0) & (tracks.age < station.lengths[tracks.case][tracks.encounter]))
    whose = tracks.encounter[joint]
    logged = station.offsets[tracks.case[whose]] + tracks.age[joint]
    states = tracks.states
    for total, own, log_values in zip(
        sums.values(), (states.host_station, states.host_speed), (station.values, speed), strict=True
    ):
        apart = own[joint] - log_values[logged]
        np.add.at(total, whose, apart * apart)
    return sums

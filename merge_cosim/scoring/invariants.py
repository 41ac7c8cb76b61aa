"""What must hold in every run, whatever the method: it is checked on the recorded tracks when they are scored."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from merge_cosim.core.units import DT, TOLERANCE, BoolArray, FloatArray
from merge_cosim.scoring.tracks import Tracks

HIGHEST_SPEED = 100.0
"""No car drives faster [m/s]; it is the highest speed limit that is taken."""
HARDEST = 12.0
"""Largest acceleration, of either sign, of a car whose model states no bounds [m/s^2]: dry tyres give less."""
SPEED_ERROR = 1e-3
"""Speeds are rounded to 1e-6 m/s, accelerations are so exact [m/s^2]."""
JUMP = 4 * TOLERANCE
"""Stations and speeds are rounded, so that a car's way in a cycle is exact to this [m], also where a car that stood
just at the place where it then changes lane is told from one in the lane (`TrafficWorld.settled`)."""
INVARIANTS = {
    "speed": f"speeds lie in 0 ... {HIGHEST_SPEED:g} m/s",
    "acceleration": f"accelerations are within the bounds that a model states, else within {HARDEST:g} m/s^2",
    "station": "stations do not decrease",
    "jump": "a car's way in a cycle is its speed times the cycle: nothing is teleported",
    "closed_form": f"SUMO moves both cars as commanded, to {TOLERANCE:g} m at the end",
    "lane": "at the end the host is on its lane, and the merging car on its own before the merging point, else on the "
    "host's",
    "contact": "where SUMO and our geometry differ about a contact, the kind of difference is known",
}
"""Each in one sentence."""


class Bounds(NamedTuple):
    """Least and largest acceleration [m/s^2]."""

    least: float = -HARDEST
    largest: float = HARDEST

    @classmethod
    def of(cls, *laws: object) -> Bounds:
        """The widest bounds among a host's laws, from their parameters."""
        least = min(float(getattr(law, "min_acceleration", -HARDEST)) for law in laws)
        return cls(least, max(float(getattr(law, "max_acceleration", HARDEST)) for law in laws))


def broken(tracks: Tracks, host: Bounds, merging: Bounds) -> dict[str, BoolArray]:
    """Which encounters break an invariant, shape (m,) each, for those invariants that are broken at all.

    Usually all hold, so extremes over all states are looked at first.

    Args:
        tracks: The m encounters.
        host: Bounds of the hosts' accelerations.
        merging: Bounds of the merging cars'.
    """
    if not len(tracks.case):
        return {}
    states, across = tracks.states, tracks.last[:-1]  # steps from one encounter to the next
    found: dict[str, BoolArray] = {}

    def within(name: str, values: FloatArray, least: float, largest: float) -> None:
        if np.minimum.reduce(values) >= least and np.maximum.reduce(values) <= largest:
            return  # no NaN here
        wrong = np.flatnonzero(~((values >= least) & (values <= largest)))
        where = found.setdefault(name, np.zeros(len(tracks.case), dtype=bool))
        where[tracks.encounter[wrong]] = True

    slack = SPEED_ERROR * DT
    way, jump = np.empty((2, len(states.host_station) - 1))
    for station, speed, bounds in (
        (states.host_station, states.host_speed, host),
        (states.merging_station, states.merging_speed, merging),
    ):
        within("speed", speed, 0.0, HIGHEST_SPEED)
        np.subtract(station[1:], station[:-1], out=way)
        np.multiply(speed[1:], DT, out=jump)
        np.subtract(way, jump, out=jump)
        jump[across] = 0.0
        within("jump", jump, -JUMP, JUMP)
        if found:  # else it follows from the two before
            way[across] = 0.0
            within("station", way, -JUMP, np.inf)
        change = np.subtract(speed[1:], speed[:-1], out=way)
        change[across] = 0.0
        within("acceleration", change, bounds.least * DT - slack, bounds.largest * DT + slack)
    return found

"""What was decided and believed on the way to the merging point: flips, since when, and the log-odds at fixed gates."""

from __future__ import annotations

import numpy as np

from merge_cosim.core.units import TOLERANCE, FloatArray, time_to_arrival
from merge_cosim.scoring.tracks import Tracks

GATES = (110, 70, 40, 20)
"""Distances of the merging car to the merging point [m] at which beliefs are kept, from far to near."""


def decisions(tracks: Tracks) -> dict[str, FloatArray]:
    """The decisions and beliefs while neither car has reached the merging point, shape (m,) each.

    `last_decision`: 1 NOT_YIELD, 0 YIELD, -1 none (also where the log-odds are NaN); `decided_from`: the cycle since
    which it stands; `log_odds_G` and `arrival_lead_G` (T_h - T_m [s]): of the first cycle in which the merging car is G
    m away or less, NaN where it started nearer, or where a car had passed the merging point.
    """
    states, age = tracks.states, tracks.age
    still_open = np.maximum(states.host_station, states.merging_station) < -TOLERANCE
    still_open[tracks.last] = False  # nothing is decided there any more
    at = np.flatnonzero(still_open)
    whose, not_yield = tracks.encounter[at], tracks.log_odds[at] >= 0.0
    flips = np.zeros(len(at), dtype=bool)
    flips[1:] = (not_yield[1:] != not_yield[:-1]) & (whose[1:] == whose[:-1])
    last_decision, decided_from, decision_flips = tracks.fill(-1.0), tracks.fill(0.0), tracks.fill(0.0)
    believed = tracks.log_odds[at]
    last_decision[whose] = np.where(np.isnan(believed), -1.0, not_yield)  # the last one of each encounter stays
    decided_from[whose[flips]] = age[at[flips]]
    np.add.at(decision_flips, whose[flips], 1.0)
    kept = {"decision_flips": decision_flips, "last_decision": last_decision, "decided_from": decided_from}
    start = states.merging_station[tracks.first]
    for gate in GATES:
        reached = tracks.reached(states.merging_station >= -gate - TOLERANCE)
        met = np.flatnonzero((reached < tracks.cycles) & (start <= -gate + TOLERANCE))
        at = tracks.first[met] + reached[met]
        met, at = met[still_open[at]], at[still_open[at]]
        log_odds, lead = tracks.fill(np.nan), tracks.fill(np.nan)
        log_odds[met] = tracks.log_odds[at]
        lead[met] = time_to_arrival(states.host_station[at], states.host_speed[at])
        lead[met] -= time_to_arrival(states.merging_station[at], states.merging_speed[at])
        lead[np.isnan(log_odds)] = np.nan
        kept |= {f"log_odds_{gate}": log_odds, f"arrival_lead_{gate}": lead}
    return kept

"""Every measure once more, by plain loops over one encounter at a time, on tracks full of ties."""

import math
from itertools import pairwise

import numpy as np
import pytest

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import TOLERANCE, time_to_arrival
from merge_cosim.scoring.decisions import GATES
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.scoring import GOAL, HOST_INTO_MERGING, MERGING_INTO_HOST, SIDE, score
from merge_cosim.scoring.tracks import Tracks

STEPS = (0.0, 0.0, TOLERANCE, 0.5, 1.0, 2.0, 3.0, 8.0)
"""Ways of a cycle [m]; sums of them meet the lines and each other exactly."""
STARTS = (-110.0, -70.0 - TOLERANCE, -40.0, -20.0, -10.0, -5.0, -2 * TOLERANCE, -TOLERANCE, 0.0, 4.0, 46.0)


def tracks(count, seed):
    """Encounters of 1 to 40 cycles, each as stations, speeds, lengths and log-odds."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        cycles = int(rng.integers(1, 41))
        host, merging = (rng.choice(STARTS) + np.append(0.0, rng.choice(STEPS, cycles)).cumsum() for _ in "hm")
        past = np.minimum(host, merging)[1:] >= -TOLERANCE
        if rng.random() < 0.5 and past.any():  # in which a failure ends at once
            cycles = 1 + int(past.argmax())
            host, merging = host[: cycles + 1], merging[: cycles + 1]
        host_speed, merging_speed = (rng.choice((0.0, 1.0, 4.0, 4.5, 9.0), cycles + 1) for _ in "hm")
        odds = rng.choice((-1.5, 0.0, 2.0, math.nan), cycles + 1, p=(0.4, 0.2, 0.38, 0.02))
        found.append((host, host_speed, merging, merging_speed, *rng.choice((4.0, 5.0, 7.5), 2), odds))
    return found


def expected(host, host_speed, merging, merging_speed, host_length, merging_length, odds, rules):
    """The measures of one encounter, written from their descriptions."""
    last = len(host) - 1
    gap, ttc, drac, ahead = [], [], [], []
    for k in range(last + 1):
        ahead.append(merging[k] - host[k] >= -TOLERANCE)
        gap.append(abs(merging[k] - host[k]) - (merging_length if ahead[k] else host_length))
        closing = host_speed[k] - merging_speed[k] if ahead[k] else merging_speed[k] - host_speed[k]
        ttc.append(max(gap[k], 0.0) / closing if closing > 0 else math.inf)
        drac.append(closing**2 / (2 * gap[k]) if closing > 0 and gap[k] > TOLERANCE else 0.0)
    both = rules.overlap_from == "both"
    begun = [merging[k] >= -TOLERANCE and (not both or host[k] >= -TOLERANCE) for k in range(last + 1)]
    start = next((k for k in range(1, last + 1) if begun[k]), None)
    failed = start is not None and gap[last] < -TOLERANCE
    later = HOST_INTO_MERGING if ahead[last] else MERGING_INTO_HOST
    scored = slice(last + 1 if start is None else start, None)
    braking = [0.0] + [(host_speed[k - 1] - host_speed[k]) / 0.1 for k in range(1, last + 1)]
    found = {
        "end_cycle": last,
        "end_station": host[last],
        "end_speed": host_speed[last],
        "end_merging_station": merging[last],
        "end_merging_speed": merging_speed[last],
        "kind": 0 if not failed else SIDE if last == start else later,
        "scored_from": -1 if start is None else start,
        "scored_to_end": start is not None and last >= start + rules.horizon_cycles,
        "min_gap_m": min(gap[scored], default=math.inf),
        "min_ttc_s": min(ttc[scored], default=math.inf),
        "max_drac": max(drac[scored], default=0.0),
        "hardest_braking": max(braking),
        "jerk_sum": sum(abs(braking[k] - braking[k - 1]) for k in range(2, last + 1)),
        "distance_m": math.nan,
        "gap_m": math.nan,
    }
    for name, station, line in (
        ("host_reached_s", host, 0.0),
        ("host_cleared_s", host, host_length),
        ("goal_s", host, GOAL),
        ("merging_reached_s", merging, 0.0),
        ("merging_cleared_s", merging, merging_length),
    ):
        k = next((k for k in range(last + 1) if station[k] >= line - TOLERANCE), 0)
        found[name] = math.nan
        if k:
            part = min(max((line - station[k - 1]) / (station[k] - station[k - 1]), 0.0), 1.0)
            found[name] = (k - 1 + part) * 0.1
            if name == "host_reached_s":
                other = merging[k - 1] + part * (merging[k] - merging[k - 1])
                found["distance_m"] = abs(other)
                found["gap_m"] = abs(other) - (merging_length if other >= -TOLERANCE else host_length)
    open_ = [k for k in range(last) if host[k] < -TOLERANCE and merging[k] < -TOLERANCE]
    flips = [k for before, k in pairwise(open_) if (odds[before] >= 0) != (odds[k] >= 0)]
    found["decision_flips"], found["decided_from"] = len(flips), flips[-1] if flips else 0
    found["last_decision"] = -1 if not open_ or math.isnan(odds[open_[-1]]) else int(odds[open_[-1]] >= 0)
    for gate in GATES:
        k = next((k for k in range(last + 1) if merging[k] >= -gate - TOLERANCE), None)
        met = k in open_ and merging[0] <= -gate + TOLERANCE
        found[f"log_odds_{gate}"] = odds[k] if met else math.nan
        found[f"arrival_lead_{gate}"] = math.nan
        if met and not math.isnan(odds[k]):
            cars = np.array([host[k], merging[k]]), np.array([host_speed[k], merging_speed[k]])
            found[f"arrival_lead_{gate}"] = -np.diff(time_to_arrival(*cars))[0]
    return found


@pytest.mark.parametrize("rules", [Rules(horizon=1.0), Rules(horizon=0.5, overlap_from="lane_change")])
def test_measures_are_those_of_plain_loops(rules):
    given = tracks(400, seed=14)
    sizes = np.array([len(one[0]) for one in given])
    columns = (np.concatenate([np.broadcast_to(one[field], len(one[0])) for one in given]) for field in range(7))
    *states, odds = columns
    found = score(Tracks(Observation(*states), odds, np.arange(400), sizes - 1), rules)
    wanted = [expected(*one, rules) for one in given]
    for name in wanted[0]:
        column = np.array([one[name] for one in wanted], dtype=float)
        np.testing.assert_allclose(found[name], column, rtol=1e-12, atol=1e-9, err_msg=name)
    assert np.bincount(found["kind"], minlength=4)[1:4].min() > 0

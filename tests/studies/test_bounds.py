"""Bounds against hand-made logs, against every sequence of accelerations, and against a linear programme."""

import json
from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog

from merge_cosim.core.encounter import NEVER, Encounters, Ragged, ReplayLog
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Setting
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.scoring.rules import Rules
from merge_cosim.studies.bounds import bounds, bounds_of, summarise_bounds
from merge_cosim.studies.minimum_delay import Ahead, Reach, earliest_pass_behind

DT = 0.1


def pair(host_station, host_speed, merging, score_until=NEVER):
    one = np.array
    log = ReplayLog(
        Ragged.of([merging]),
        Ragged.of([np.full(len(merging), 10.0)]),
        Ragged.of([merging]),
        one([9]),
        one([score_until]),
    )
    text = {name: one(["x"]) for name in ("case", "site", "source", "car")}
    numbers = {
        "host_station": one([host_station]),
        "host_speed": one([host_speed]),
        "host_length": one([5.0]),
        "merging_station": merging[:1],
        "merging_speed": one([(merging[1] - merging[0]) / DT]),
        "merging_length": one([5.0]),
        "merge_position": one([0.0]),
    }
    flags = {"smoothed_source": one([False]), "length_missing": one([False])}
    return Encounters(**text, **numbers, label=one([1]), **flags, log=log)


def steady(station, speed, cycles=120):
    return station + speed * DT * np.arange(cycles)


def bound(*case, **settings):
    return bounds(load_scenario("us101-replay", settings), pair(*case)).iloc[0]


def test_a_host_that_must_brake():
    # both arrive together: full throttle hits, full braking stays behind
    row = bound(-40.0, 10.0, steady(-40.0, 10.0))
    assert (row["feasible"], row["by_braking"]) == (True, True)
    ahead = bound(-40.0, 20.0, steady(-60.0, 10.0))  # 2 s against 6 s
    assert ahead["by_throttle"]
    assert ahead["min_delay_s"] <= 0.0  # nothing is sooner than full throttle, not even free driving
    assert ahead["found_delay_s"] == ahead["min_delay_s"]


def test_no_way_at_all():
    # the host cannot stop before the point any more, and the merging car stands across it
    row = bound(-10.0, 20.0, np.concatenate([steady(-1.0, 10.0, 2), np.full(100, 0.0)]))
    assert not row["feasible"]
    assert np.isnan(row[["min_delay_s", "found_delay_s"]].to_list()).all()
    assert row["infeasible_in_time"]


def test_a_slow_car_ahead_costs_at_least_its_own_time():
    # the merging car crawls at 2 m/s and is scored for 3 s from the host's arrival on
    row = bound(-30.0, 15.0, steady(-2.0, 2.0))
    assert row["by_braking"]
    assert not row["by_throttle"]
    assert row["min_delay_s"] > 1.0
    assert row["found_delay_s"] == pytest.approx(row["min_delay_s"], abs=0.3)  # by the search, on a coarser grid
    assert summarise_bounds(bounds(load_scenario("us101-replay"), pair(-30.0, 15.0, steady(-2.0, 2.0))))[0]["n"] == 1


def test_bounds_are_for_two_cars():
    with pytest.raises(UserError, match="two cars alone"):
        bounds_of("traffic-light", {}, None, None)
    with pytest.raises(UserError, match="overlap_from"):
        bounds_of("designed-2", {"test.overlap_from": "lane_change"}, None, None)


def test_the_earliest_passage_against_every_sequence_of_accelerations():
    rules = Rules(horizon=0.3, time_out=0.8)
    for host, speed, merging in (
        (-1.5, 4.0, steady(-0.5, 9.0)),
        (-2.0, 5.0, steady(0.2, 4.0)),
        (-1.0, 3.0, steady(-1.0, 30.0)),
    ):
        found = earliest_pass_behind(
            Ahead.of(pair(host, speed, merging), 0, rules), host, speed, 0.6, Reach(29.0, speed_step=0.1)
        )
        best = np.inf
        plans = np.array(list(product((-4.0, -2.0, -1.0, 0.0, 1.0, 2.0), repeat=7)))
        v = np.maximum(speed + np.cumsum(plans * DT, axis=1), 0.0)
        s = host + np.cumsum(v * DT, axis=1)
        m = merging[1:8]
        both = (s >= -1e-6) & (m >= -1e-6)
        first = np.where(both.any(axis=1), both.argmax(axis=1), 99)[:, None]
        scored = (np.arange(7) >= first) & (np.arange(7) <= first + 3)
        behind = s <= m - 5.0 + 1e-6
        host_late = ~((s >= -1e-6) & (m < -1e-6)).any(axis=1)  # who arrives before him is not behind
        safe = (behind | ~scored).all(axis=1) & host_late
        # what is still scored beyond the plan: full braking must carry it
        tail_v, tail_s = v[:, -1], s[:, -1]
        for k in range(7, 11):
            tail_v = np.maximum(tail_v - 0.4, 0.0)
            tail_s = tail_s + tail_v * DT
            safe &= (tail_s <= merging[k + 1] - 5.0 + 1e-6) | (k > first[:, 0] + 3) | (first[:, 0] > 6)
        reached = (s >= 0.6) & safe[:, None]
        if reached.any():
            best = (np.flatnonzero(reached.any(axis=0))[0] + 1) * DT
        assert found == pytest.approx(best) or (found > 0.7 and best == np.inf)


def programme(ahead, station, speed, goal, arrival, end, limit=29.0):
    """Whether some accelerations arrive in that cycle, stay behind and are past the goal at `end`."""
    n = max(end, arrival + ahead.horizon)
    to_speed = np.tril(np.ones((n, n))) * DT
    to_station = np.cumsum(to_speed, axis=0) * DT
    free = station + speed * DT * np.arange(1, n + 1)
    rows, limits = [to_speed, -to_speed], [np.full(n, limit - speed), np.full(n, speed)]
    for k in range(1, n + 1):
        if k < arrival:
            rows.append(to_station[k - 1]), limits.append(-1e-6 - free[k - 1])
        elif k <= arrival + ahead.horizon and np.isfinite(ahead.rear[k]):
            rows.append(to_station[k - 1]), limits.append(ahead.rear[k] - free[k - 1])
    rows += [-to_station[arrival - 1], -to_station[end - 1]]
    limits += [free[arrival - 1], free[end - 1] - goal]
    a, b = np.vstack([np.atleast_2d(row) for row in rows]), np.concatenate([np.atleast_1d(x) for x in limits])
    return linprog(np.zeros(n), A_ub=a, b_ub=b, bounds=(-4.0, 2.0), method="highs").status == 0


@pytest.mark.parametrize(("host", "speed", "merging"), [(-30.0, 15.0, (-10.0, 6.0)), (-60.0, 20.0, (-35.0, 10.0))])
def test_the_earliest_passage_against_a_linear_programme(host, speed, merging):
    log = steady(*merging, cycles=200)
    ahead = Ahead.of(pair(host, speed, log), 0, Rules())
    found = round(earliest_pass_behind(ahead, host, speed, 50.0, Reach(29.0)) / DT)
    arrivals = range(ahead.arrival, found)
    assert any(programme(ahead, host, speed, 50.0, arrival, found) for arrival in arrivals)
    assert not any(programme(ahead, host, speed, 50.0, arrival, found - 2) for arrival in arrivals)


def test_finer_speeds_change_the_delay_by_a_cycle_at_most():
    ahead = Ahead.of(pair(-30.0, 15.0, steady(-2.0, 2.0)), 0, Rules())
    times = [earliest_pass_behind(ahead, -30.0, 15.0, 50.0, Reach(29.0, speed_step=step)) for step in (0.2, 0.05, 0.02)]
    assert times[0] >= times[1] >= times[2] > times[1] - 0.11


@pytest.mark.slow
def test_bounds_of_real_pairs(data_dir, tmp_path):
    from command import merge_cosim

    done = merge_cosim("bounds", "us101-replay", "--data", data_dir, "--json", "--out", "b.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)
    assert row["infeasible"] == 0  # a human drove there
    assert len((tmp_path / "b.csv").read_text().splitlines()) == row["n"] + 1
    assert merge_cosim("bounds", "traffic-light", cwd=tmp_path).returncode == 2
    assert Setting().speed_limit == 29.0

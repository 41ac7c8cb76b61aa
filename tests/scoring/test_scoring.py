"""Scoring against cases computed by hand."""

from dataclasses import replace

import numpy as np
import pytest
from cases import random_encounters

from merge_cosim.core.encounter import NEVER, Ragged, ReplayLog
from merge_cosim.core.observation import Observation
from merge_cosim.scoring.human_difference import human_difference
from merge_cosim.scoring.rules import Rules, Watch, expected_cycles
from merge_cosim.scoring.scoring import HOST_INTO_LEADER, HOST_INTO_MERGING, MERGING_INTO_HOST, SIDE, score
from merge_cosim.scoring.surroundings import AROUND
from merge_cosim.scoring.tracks import Tracks

DEFAULTS = Rules()


def laid(host, merging, length=5.0, odds=None, speeds=None):
    """One encounter from lists of stations, its speeds (the way of each cycle, unless given) and its beliefs.

    `length` is that of both cars, or of host and merging car.
    """
    host, merging = np.array(host, dtype=float), np.array(merging, dtype=float)
    ways = [np.concatenate([np.diff(station)[:1], np.diff(station)]) / 0.1 for station in (host, merging)]
    host_speed, merging_speed = (np.full(len(host), speed) for speed in speeds) if speeds else ways
    lengths = (np.full(len(host), float(one)) for one in np.broadcast_to(length, 2))
    states = Observation(host, host_speed, merging, merging_speed, *lengths)
    odds = np.zeros(len(host)) if odds is None else np.array(odds, dtype=float)
    return Tracks(states, odds, np.array([0]), np.array([len(host) - 1]))


def watched(tracks, rules):
    """The cycle in which an encounter is over, as the loop finds it; None if it goes on."""
    watch, states = Watch(1, rules), tracks.states
    watch.reset(np.array([0]), np.array([NEVER]))
    for k in range(1, len(states.host_station)):
        now = Observation(*(getattr(states, field)[k : k + 1] for field in Observation.__match_args__))
        if watch.over(np.array([k]), now)[0]:
            return k
    return None


def run(host, merging, length=5.0, rules=DEFAULTS, decisions=None):
    """Score one encounter from lists of stations up to its end; returns the measures and the cycle of the end."""
    odds = [1.0 if decision else -1.0 for decision in decisions] if decisions else None
    over = watched(laid(host, merging, length), rules)
    until = None if over is None else over + 1
    tracks = laid(host[:until], merging[:until], length, None if odds is None else odds[:until])
    return score(tracks, rules), over


def line(start, speed, cycles=60):
    return [start + 0.1 * speed * k for k in range(cycles)]


def test_apart_by_a_car_length_exactly_is_no_overlap():
    columns, over = run(line(-5, 10), line(-10, 10))
    assert columns["kind"][0] == 0
    assert columns["min_gap_m"][0] == pytest.approx(0.0, abs=1e-9)
    assert over == 10 + 30  # both past 0 at cycle 10, then the horizon of 3 s
    assert columns["scored_to_end"][0]
    assert not run(line(-5, 10, 40), line(-10, 10, 40))[0]["scored_to_end"][0]  # a cycle is missing


def test_side_overlap_fails_at_the_first_cycle_with_both_past():
    columns, over = run(line(-5, 10), line(-8, 10))
    assert columns["kind"][0] == SIDE
    assert over == 8


def test_who_runs_into_whom():
    # the merging car reaches 0 at once and crawls; the host closes in from behind
    columns, _ = run(line(-1, 10), line(7, 2))
    assert columns["kind"][0] == HOST_INTO_MERGING
    columns, _ = run(line(7, 2), line(-1, 10))
    assert columns["kind"][0] == MERGING_INTO_HOST


def test_overlap_upstream_of_the_merging_point_is_none():
    columns, over = run(line(-50, 5), line(-50, 5))
    assert columns["kind"][0] == 0
    assert over is None


def test_lane_change_rule_counts_from_the_merging_car_alone():
    host, merging = line(-3, 1), line(-1, 10)
    assert run(host, merging)[0]["kind"][0] == 0
    strict = run(host, merging, rules=Rules(overlap_from="lane_change"))[0]
    assert strict["kind"][0] == HOST_INTO_MERGING or strict["kind"][0] == SIDE


def test_distance_is_interpolated_at_the_hosts_crossing():
    # the host crosses 0 a quarter into cycle 3; the merging car then stands at 20 + 0.1 * 2.25 * 8
    columns, _ = run(line(-2.25, 10), line(20, 8))
    assert columns["host_reached_s"][0] == pytest.approx(0.225)
    assert columns["distance_m"][0] == pytest.approx(20 + 0.225 * 8)
    assert columns["gap_m"][0] == pytest.approx(20 + 0.225 * 8 - 5)


def test_the_gap_at_the_hosts_crossing_leaves_out_the_leaders_length():
    assert run(line(-2.25, 10), line(20, 8), length=(4, 7))[0]["gap_m"][0] == pytest.approx(20 + 0.225 * 8 - 7)
    assert run(line(-2.25, 10), line(-20, 8), length=(4, 7))[0]["gap_m"][0] == pytest.approx(20 - 0.225 * 8 - 4)


def test_time_to_collision_is_gap_over_closing_speed():
    columns, _ = run(line(0.0, 10, 12), line(25, 8, 12))
    # smallest at the last cycle: gap 25 - 5 - 0.2 * 11, closing at 2 m/s
    assert columns["min_ttc_s"][0] == pytest.approx((20 - 0.2 * 11) / 2)


def test_decisions_count_until_one_car_is_there():
    host, merging = line(-5.5, 10, 30), line(-30, 10, 30)
    decisions = [False, True, True, False, False] + [False] * 25
    columns, _ = run(host, merging, decisions=decisions)
    assert columns["decision_flips"][0] == 2
    assert columns["last_decision"][0] == 0
    # a change of mind after the host is through does not count
    late = run(host, merging, decisions=[False] * 10 + [True] * 20)[0]
    assert late["decision_flips"][0] == 0
    assert late["last_decision"][0] == 0


def test_hardest_braking_is_the_largest_deceleration():
    host = [-50.0, -48.0, -46.1, -44.3, -42.5]
    columns, _ = run(host, line(-80, 5, 5))
    assert columns["hardest_braking"][0] == pytest.approx(10.0)  # 20 -> 19 m/s in 0.1 s


def test_time_out_ends_an_encounter():
    columns, over = run(line(-90, 0.0, 500), line(-90, 0.0, 500), rules=Rules(time_out=2.0))
    assert over == 20
    assert columns["scored_from"][0] == -1


def test_deceleration_to_avoid_a_crash_is_half_the_squared_closing_speed_over_the_gap():
    columns, _ = run(line(0.0, 10, 12), line(25, 8, 12))
    assert columns["max_drac"][0] == pytest.approx(2.0**2 / (2 * (20 - 0.2 * 11)))
    assert run(line(0.0, 8, 12), line(25, 10, 12))[0]["max_drac"][0] == 0.0  # never closing
    touching, _ = run(line(0.0, 10, 12), line(5.2, 8, 12))  # gap 0.2 m at first, none after one cycle
    assert touching["kind"][0] == HOST_INTO_MERGING
    assert touching["max_drac"][0] == 0.0
    close, _ = run(line(0.0, 10, 12), line(5.5, 9, 12))  # gap 0.1 m after four cycles, the last one before they touch
    assert close["max_drac"][0] == pytest.approx(1.0 / (2 * 0.1))


def test_bumpers_pass_the_merging_point_at_interpolated_times():
    columns, _ = run(line(-2.25, 10), line(-20, 8), length=4.0)
    assert columns["host_reached_s"][0] == pytest.approx(0.225)
    assert columns["host_cleared_s"][0] == pytest.approx(0.625)
    assert columns["merging_reached_s"][0] == pytest.approx(2.5)
    assert columns["merging_cleared_s"][0] == pytest.approx(3.0)
    assert columns["goal_s"][0] == pytest.approx(5.225)
    late, over = run(line(-2.25, 10), line(0.0, 8), length=4.0)  # the merging car starts on the point
    assert np.isnan(late["merging_reached_s"][0])
    assert late["kind"][0] == SIDE
    assert over == 3


def test_jerk_is_summed_from_the_second_cycle_on():
    # speeds 20, 19, 19, 18 m/s in cycles 1 to 4: decelerations 0 (start at 20), 10, 0, 10 m/s^2
    columns, _ = run([-50.0, -48.0, -46.1, -44.2, -42.4], line(-80, 5, 5))
    assert columns["jerk_sum"][0] == pytest.approx(10 + 10 + 10)  # in m/s^2 per cycle
    tracks = laid(line(-50, 20, 5), line(-80, 5, 5))
    tracks.states.host_speed[:] = [20.0, 18.0, 18.0, 17.0, 17.0]  # 20, 0, 10, 0 m/s^2: what came before is not known
    assert score(tracks, Rules())["jerk_sum"][0] == pytest.approx(20 + 10 + 10)


def test_a_decision_stands_from_its_last_change_on():
    columns, _ = run(line(-30, 10, 30), line(-30, 10, 30), decisions=[False, True, True, False] + [True] * 26)
    assert columns["decided_from"][0] == 4
    assert columns["decision_flips"][0] == 3


def test_log_odds_are_kept_at_the_gates():
    host, merging = line(-90.0, 10, 100), line(-75.5, 10, 100)
    found = score(laid(host, merging, odds=range(100)), Rules())
    assert np.isnan(found["log_odds_110"][0])  # he starts nearer
    assert [found[name][0] for name in ("log_odds_70", "log_odds_40", "log_odds_20")] == [6.0, 36.0, 56.0]
    assert found["arrival_lead_70"][0] == pytest.approx((90.0 - 75.5) / 10)
    on_it = score(laid([-90, -89], [-70.0, -69], odds=[7.0, 8.0]), Rules())
    assert on_it["log_odds_70"][0] == 7.0  # exactly at a gate is at it


def test_a_gate_after_the_host_has_passed_is_missing():
    host, merging = line(-11.0, 10, 60), line(-45.0, 5, 60)
    columns, _ = run(host, merging, decisions=[False] * 60)
    assert columns["log_odds_40"][0] == -1.0  # at 1.0 s, when the host has 1 m to go
    assert np.isnan(columns["log_odds_20"][0])


def test_difference_to_the_logged_host_is_summed_while_his_log_lasts():
    track = Ragged.of([np.array([0.0, 0.5]), np.array([-50.0, -49.0, -48.0])])
    log = ReplayLog(track, track, track, np.array([1, 2]), np.array([NEVER, NEVER]))
    tracks = laid([-50, -49.5, -48.2, -40.0], [-90] * 4)
    tracks.states.host_speed[:] = [10.0, 5.0, 13.0, 82.0]
    tracks.case[:] = 1
    found = score(tracks, Rules(), log)
    assert found["station_square_sum"][0] == pytest.approx(0.5**2 + 0.2**2)
    assert found["speed_square_sum"][0] == pytest.approx(5.0**2 + 3.0**2)
    assert human_difference(tracks, None)["station_square_sum"].tolist() == [0.0]


def test_encounters_are_scored_alike_alone_and_together():
    courses = [laid(line(-5, 10), line(-8, 10)), laid(line(-2.25, 10), line(20, 8)), laid(line(-90, 0), line(-50, 9))]
    fields = Observation.__match_args__
    states = (np.concatenate([getattr(one.states, field) for one in courses]) for field in fields)
    cycles = np.concatenate([one.cycles for one in courses])
    together = score(Tracks(Observation(*states), np.zeros(180), np.arange(3), cycles), Rules())
    for number, one in enumerate(courses):
        for name, values in score(one, Rules()).items():
            np.testing.assert_array_equal(values, together[name][number : number + 1], err_msg=name)


def test_the_horizon_counts_from_the_scored_cycle_and_a_failure_ends_at_once():
    assert watched(laid(line(-5, 10), line(-30, 10)), Rules(horizon=1.0)) == 40  # both past 0 at cycle 30
    assert watched(laid(line(-5, 10), line(-30, 10)), Rules(horizon=1.0, time_out=3.5)) == 35
    assert watched(laid(line(-5, 10), line(-8, 10)), Rules(horizon=1.0)) == 8


def test_longer_approaches_are_expected_to_last_longer():
    encounters = random_encounters(50, seed=8)
    cycles = expected_cycles(encounters, Rules())
    further = expected_cycles(encounters.take(np.arange(50)), Rules(horizon=4.0))
    assert (further >= cycles).all()
    assert (cycles <= 400).all()
    nearest = np.argmin(cycles)
    assert encounters.host_station[nearest] > np.min(encounters.host_station)


def test_the_length_of_a_case_is_that_of_the_later_car_at_1_m_s2_and_the_horizon():
    encounters = random_encounters(20, seed=8)
    cars = (
        (encounters.host_station, encounters.host_speed),
        (encounters.merging_station, encounters.merging_speed),
    )
    for rules in (Rules(), Rules(time_out=6.0)):
        for n, cycles in enumerate(expected_cycles(encounters, rules)):
            # The time t in which a car covers its way: way = speed t + t^2 / 2.
            times = [max(np.roots([0.5, speed[n], min(station[n], 0.0)]).real) for station, speed in cars]
            assert cycles == pytest.approx(10 * min(max(times) + 3.0, rules.time_out))


def test_nothing_to_score_gives_no_rows():
    encounters = random_encounters(3, seed=9)
    tracks = Tracks.of(encounters, [], [])
    assert all(values.shape == (0,) for values in score(tracks, Rules()).values())


def test_a_contact_with_the_leader_counts_where_the_two_had_none():
    """The host touches its leader by more than the tolerance, exactly by it, or not; in the last it hits the other."""
    for merging, gaps, kind in (
        (line(-200, 10), [9.0, -0.1], HOST_INTO_LEADER),
        (line(-200, 10), [9.0, -1e-6], 0),
        (line(-200, 10), [9.0, 0.1], 0),
        (line(3, 10), [9.0, -0.1], SIDE),
        (line(3, 10), [9.0, 0.1], SIDE),
    ):
        tracks = laid(line(0, 10, 2), merging[:2])
        around = {name: np.array(gaps) for name in AROUND}
        columns = score(replace(tracks, around=around), DEFAULTS)
        assert columns["kind"].tolist() == [kind]
        assert columns["min_leader_gap_m"].tolist() == [min(gaps)]


def test_a_watch_grows_to_the_slots_there_are():
    watch = Watch(3, DEFAULTS)
    watch.make_room(5)
    states = laid([-9.0] * 5, [-9.0] * 5).states
    assert watch.over(np.full(5, 10), states).tolist() == [False] * 5
    watch.reset(np.array([4]), np.array([10]))
    assert watch.over(np.full(5, 10), states).tolist() == [False] * 4 + [True]

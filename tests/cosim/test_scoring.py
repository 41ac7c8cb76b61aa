"""Scoring against cases computed by hand."""

import numpy as np
import pytest

from merge_cosim.cosim.scoring import HOST_INTO_MERGING, MERGING_INTO_HOST, SIDE, Rules, Scorer
from merge_cosim.encounter import NEVER, Ragged, ReplayLog
from merge_cosim.observation import Observation


def score(host, merging, length=5.0, rules=None, decisions=None):
    """Score one encounter from lists of stations; returns the scorer and the cycle at which it was over."""
    scorer = Scorer(1, rules or Rules())
    scorer.reset(np.array([0]), np.array([0]))

    def state(k):
        before = max(k - 1, 0)
        return Observation(
            np.array([host[k]]),
            np.array([(host[k] - host[before]) / 0.1 if k else (host[1] - host[0]) / 0.1]),
            np.array([merging[k]]),
            np.array([(merging[k] - merging[before]) / 0.1 if k else (merging[1] - merging[0]) / 0.1]),
            np.array([length]),
            np.array([length]),
        )

    for k in range(1, len(host)):
        if decisions:
            odds = np.array([1.0 if decisions[k - 1] else -1.0])
            scorer.decided(np.array([k - 1]), state(k - 1), odds, odds >= 0)
        if scorer.moved(np.array([k]), state(k - 1), state(k), np.array([False]))[0]:
            return scorer.columns, k
    return scorer.columns, None


def line(start, speed, cycles=60):
    return [start + 0.1 * speed * k for k in range(cycles)]


def test_apart_by_a_car_length_exactly_is_no_overlap():
    columns, over = score(line(-5, 10), line(-10, 10))
    assert columns["kind"][0] == 0
    assert columns["min_gap_m"][0] == pytest.approx(0.0, abs=1e-9)
    assert over == 10 + 30  # both past 0 at cycle 10, then the horizon of 3 s


def test_side_overlap_fails_at_the_first_cycle_with_both_past():
    columns, over = score(line(-5, 10), line(-8, 10))
    assert columns["kind"][0] == SIDE
    assert over == 8


def test_who_runs_into_whom():
    # the merging car reaches 0 at once and crawls; the host closes in from behind
    columns, _ = score(line(-1, 10), line(7, 2))
    assert columns["kind"][0] == HOST_INTO_MERGING
    columns, _ = score(line(7, 2), line(-1, 10))
    assert columns["kind"][0] == MERGING_INTO_HOST


def test_overlap_upstream_of_the_merging_point_is_none():
    columns, over = score(line(-50, 5), line(-50, 5))
    assert columns["kind"][0] == 0
    assert over is None


def test_lane_change_rule_counts_from_the_merging_car_alone():
    host, merging = line(-3, 1), line(-1, 10)
    assert score(host, merging)[0]["kind"][0] == 0
    strict = score(host, merging, rules=Rules(overlap_from="lane_change"))[0]
    assert strict["kind"][0] == HOST_INTO_MERGING or strict["kind"][0] == SIDE


def test_distance_is_interpolated_at_the_hosts_crossing():
    # the host crosses 0 a quarter into cycle 3; the merging car then stands at 20 + 0.1 * 2.25 * 8
    columns, _ = score(line(-2.25, 10), line(20, 8))
    assert columns["host_reached_s"][0] == pytest.approx(0.225)
    assert columns["distance_m"][0] == pytest.approx(20 + 0.225 * 8)
    assert columns["gap_m"][0] == pytest.approx(20 + 0.225 * 8 - 5)


def test_time_to_collision_is_gap_over_closing_speed():
    columns, _ = score(line(0.0, 10, 12), line(25, 8, 12))
    # smallest at the last cycle: gap 25 - 5 - 0.2 * 11, closing at 2 m/s
    assert columns["min_ttc_s"][0] == pytest.approx((20 - 0.2 * 11) / 2)


def test_decisions_count_until_one_car_is_there():
    host, merging = line(-5.5, 10, 30), line(-30, 10, 30)
    decisions = [False, True, True, False, False] + [False] * 25
    columns, _ = score(host, merging, decisions=decisions)
    assert columns["decision_flips"][0] == 2
    assert columns["last_decision"][0] == 0
    # a change of mind after the host is through does not count
    late = score(host, merging, decisions=[False] * 10 + [True] * 20)[0]
    assert late["decision_flips"][0] == 0
    assert late["last_decision"][0] == 0


def test_hardest_braking_is_the_largest_deceleration():
    host = [-50.0, -48.0, -46.1, -44.3, -42.5]
    columns, _ = score(host, line(-80, 5, 5))
    assert columns["hardest_braking"][0] == pytest.approx(10.0)  # 20 -> 19 m/s in 0.1 s


def test_time_out_ends_an_encounter():
    columns, over = score(line(-90, 0.0, 500), line(-90, 0.0, 500), rules=Rules(time_out=2.0))
    assert over == 20
    assert columns["scored_from"][0] == -1


def test_deceleration_to_avoid_a_crash_is_half_the_squared_closing_speed_over_the_gap():
    columns, _ = score(line(0.0, 10, 12), line(25, 8, 12))
    assert columns["max_drac"][0] == pytest.approx(2.0**2 / (2 * (20 - 0.2 * 11)))
    assert score(line(0.0, 8, 12), line(25, 10, 12))[0]["max_drac"][0] == 0.0  # never closing
    touching, _ = score(line(0.0, 10, 12), line(5.2, 8, 12))  # gap 0.2 m at first, none after one cycle
    assert touching["kind"][0] == HOST_INTO_MERGING
    assert touching["max_drac"][0] == 0.0


def test_bumpers_pass_the_merging_point_at_interpolated_times():
    columns, _ = score(line(-2.25, 10), line(-20, 8), length=4.0)
    assert columns["host_reached_s"][0] == pytest.approx(0.225)
    assert columns["host_cleared_s"][0] == pytest.approx(0.625)
    assert columns["merging_reached_s"][0] == pytest.approx(2.5)
    assert columns["merging_cleared_s"][0] == pytest.approx(3.0)
    assert columns["goal_s"][0] == pytest.approx(5.225)
    late, over = score(line(-2.25, 10), line(0.0, 8), length=4.0)  # the merging car starts on the point
    assert np.isnan(late["merging_reached_s"][0])
    assert late["kind"][0] == SIDE
    assert over == 3


def test_jerk_is_summed_from_the_second_cycle_on():
    # speeds 20, 19, 19, 18 m/s in cycles 1 to 4: decelerations 0 (start at 20), 10, 0, 10 m/s^2
    columns, _ = score([-50.0, -48.0, -46.1, -44.2, -42.4], line(-80, 5, 5))
    assert columns["jerk_sum"][0] == pytest.approx(10 + 10 + 10)  # in m/s^2 per cycle


def test_a_decision_stands_from_its_last_change_on():
    columns, _ = score(line(-30, 10, 30), line(-30, 10, 30), decisions=[False, True, True, False] + [True] * 26)
    assert columns["decided_from"][0] == 4
    assert columns["decision_flips"][0] == 3


def test_log_odds_are_kept_at_the_gates():
    host, merging = line(-90.0, 10, 100), line(-75.5, 10, 100)
    scorer = Scorer(1, Rules())
    scorer.reset(np.array([0]), np.array([0]))
    for k in range(100):
        now = Observation(*(np.array([x]) for x in (host[k], 10.0, merging[k], 10.0, 5.0, 5.0)))
        odds = np.array([float(k)])
        scorer.decided(np.array([k]), now, odds, odds >= 0)
    kept = {name: scorer.columns[name][0] for name in ("log_odds_110", "log_odds_70", "log_odds_40", "log_odds_20")}
    assert np.isnan(kept["log_odds_110"])  # he starts nearer
    assert [kept[name] for name in list(kept)[1:]] == [6.0, 36.0, 56.0]
    assert scorer.columns["arrival_lead_70"][0] == pytest.approx((90.0 - 75.5) / 10)
    on_it = Scorer(1, Rules())
    on_it.decided(np.array([0]), Observation(*(np.array([x]) for x in (-90, 10.0, -70.0, 10.0, 5, 5))), odds, odds >= 0)
    assert on_it.columns["log_odds_70"][0] == odds[0]  # exactly at a gate is at it


def test_a_gate_after_the_host_has_passed_is_missing():
    host, merging = line(-11.0, 10, 60), line(-45.0, 5, 60)
    columns, _ = score(host, merging, decisions=[False] * 60)
    assert columns["log_odds_40"][0] == -1.0  # at 1.0 s, when the host has 1 m to go
    assert np.isnan(columns["log_odds_20"][0])


def test_difference_to_the_logged_host_is_summed_while_his_log_lasts():
    track = Ragged.of([np.array([0.0, 0.5]), np.array([-50.0, -49.0, -48.0])])
    log = ReplayLog(track, track, track, np.array([1, 2]), np.array([NEVER, NEVER]))
    scorer = Scorer(1, Rules(), log)
    scorer.reset(np.array([0]), np.array([1]))
    for k, (station, speed) in enumerate([(-49.5, 5.0), (-48.2, 13.0), (-40.0, 82.0)], start=1):
        now = Observation(*(np.array([x]) for x in (station, speed, -90.0, 5.0, 5.0, 5.0)))
        scorer.moved(np.array([k]), now, now, np.array([False]))
    assert scorer.columns["station_square_sum"][0] == pytest.approx(0.5**2 + 0.2**2)
    assert scorer.columns["speed_square_sum"][0] == pytest.approx(5.0**2 + 3.0**2)

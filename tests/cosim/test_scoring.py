"""Scoring against cases computed by hand."""

import numpy as np
import pytest

from merge_cosim.cosim.scoring import HOST_INTO_MERGING, MERGING_INTO_HOST, SIDE, Rules, Scorer
from merge_cosim.observation import Observation


def score(host, merging, length=5.0, rules=None, decisions=None):
    """Score one encounter from lists of stations; returns the scorer and the cycle at which it was over."""
    scorer = Scorer(1, rules or Rules())
    scorer.reset(np.array([0]))

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
            scorer.decided(state(k - 1), np.array([decisions[k - 1]]))
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

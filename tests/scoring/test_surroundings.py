"""What came near a host beside the merging car."""

import numpy as np
import pytest

from merge_cosim.core.observation import Observation
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.scoring import KINDS, score
from merge_cosim.scoring.surroundings import AROUND
from merge_cosim.scoring.tracks import Tracks


def tracks(gap, closing, follower):
    n = len(gap)
    host = -30.0 + 10.0 * np.arange(n)
    states = Observation(host, np.full(n, 20.0), host - 30.0, np.full(n, 20.0), np.full(n, 4.0), np.full(n, 5.0))
    around = dict(zip(AROUND, (np.array(gap), np.array(closing), np.array(follower)), strict=True))
    return Tracks(states, np.zeros(n), np.array([0]), np.array([n - 1]), around)


def test_running_into_the_leader_is_a_failure_of_its_own():
    found = score(tracks([12.0, 6.0, 1.0, -0.5], [15.0] * 4, [8.0, 7.0, 6.0, 5.0]), Rules())
    assert KINDS[int(found["kind"][0])] == "host_into_leader"
    assert found["min_leader_gap_m"][0] == -0.5
    assert found["min_follower_gap_m"][0] == 5.0
    assert found["min_leader_ttc_s"][0] == 0.0


def test_time_to_collision_with_the_leader_is_gap_over_closing_speed():
    found = score(tracks([12.0, 6.0, 9.0], [15.0, 15.0, -1.0], [np.inf] * 3), Rules())
    assert found["min_leader_ttc_s"][0] == pytest.approx(6.0 / 15.0)
    assert found["kind"][0] == 0
    away = score(tracks([12.0, np.inf], [-1.0, 20.0], [np.inf] * 2), Rules())
    assert np.isinf(away["min_leader_ttc_s"][0])


def test_two_cars_alone_have_no_such_measures():
    alone = tracks([1.0, 1.0], [0.0, 0.0], [1.0, 1.0])
    assert "min_leader_gap_m" not in score(Tracks(alone.states, alone.log_odds, alone.case, alone.cycles), Rules())

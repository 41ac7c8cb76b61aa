"""Meetings are scored as the encounters of the pair tests are."""

import numpy as np
import pytest
from cases import random_encounters

from merge_cosim.controllers.base import controllers
from merge_cosim.core.observation import Setting
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.scoring.scoring import KINDS, Rules
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import simulate
from merge_cosim.simulation.worlds.actors import Actor
from merge_cosim.simulation.worlds.meeting_scores import encounters_of, score, to_be_scored
from merge_cosim.simulation.worlds.meetings import Ending, Meeting
from merge_cosim.simulation.worlds.tiles import ClosedFormWorld

POINT = 40.0
"""Where the cars merge [m past the gore]."""
NO_LEADER = (np.inf, 0.0, np.inf, 0.0)


def as_meeting(encounters, row, trace, columns):
    """What a scene would have recorded of an encounter of the pair test."""
    names = ("host_station_m", "host_speed_m_s", "merging_station_m", "merging_speed_m_s", "log_odds")
    seen = np.array([trace[name] for name in names]).T
    ends = ("end_station", "end_speed", "end_merging_station", "end_merging_speed")
    seen = np.vstack([seen, [*(columns[name][row] for name in ends), *seen[-1, 4:]]])
    seen[:, [0, 2]] += POINT
    host, merging = (
        Actor(name, float(length[row]), 2.5)
        for name, length in (("h", encounters.host_length), (f"m{row}", encounters.merging_length))
    )
    states = [np.array([*state, *NO_LEADER]) for state in seen]
    return Meeting(host, merging, 0, states, 0, POINT, ending=Ending.SCORED)


@pytest.mark.parametrize("method", ["always-go", "slot-time"])
def test_the_same_motion_has_the_same_measures(method):
    encounters = random_encounters(60, 3)
    driver = HostDriver(estimators[method](), controllers["acc"]())
    run = simulate(
        ClosedFormWorld(60), encounters, driver, merging_cars["designed"](), Rules(), Setting(), traced=range(60)
    )
    meetings = [as_meeting(encounters, row, run.traces[row], run.columns) for row in range(60)]
    ours = encounters_of(to_be_scored(meetings), "000", "us101", "traffic")
    np.testing.assert_allclose(ours.host_station, encounters.host_station, atol=2e-6)
    scored, others = score(meetings, ours, Rules())
    assert {KINDS[int(kind)] for kind in run.columns["kind"]} > {""}
    for name, expected in run.columns.items():
        if name != "sumo_collision":
            np.testing.assert_allclose(scored.columns[name], expected, atol=1e-4, err_msg=name)
    assert np.isinf(others["min_leader_gap_m"]).all()


def test_running_into_the_leader_is_a_failure_of_its_own():
    host, merging = Actor("h", 4.0, 2.5), Actor("m", 5.0, 2.5)
    gaps = (12.0, 6.0, 1.0, -0.5)
    states = [np.array([10.0 * i, 20, -30 + 10.0 * i, 20, -1.0, gap, 5, 8.0 - i, 0]) for i, gap in enumerate(gaps)]
    meeting = Meeting(host, merging, 0, states, 2, 0.0, ending=Ending.CENSORED)
    scored, others = score([meeting], encounters_of([meeting], "000", "us101", "traffic"), Rules())
    assert KINDS[int(scored.columns["kind"][0])] == "host_into_leader"
    assert others["min_leader_gap_m"][0] == -0.5
    assert others["min_follower_gap_m"][0] == 5.0
    assert others["min_leader_ttc_s"][0] == 0.0
    few = Meeting(host, merging, 0, states[:2], 2, 0.0, ending=Ending.CENSORED)
    _, others = score([few], encounters_of([few], "000", "us101", "traffic"), Rules())
    assert others["min_leader_ttc_s"][0] == pytest.approx(6.0 / 15.0)


def test_only_cars_that_merged_next_to_the_host_are_scored():
    host, merging = Actor("h", 4.0, 2.5), Actor("m", 5.0, 2.5)
    states = [np.zeros(9), np.zeros(9)]
    found = [Meeting(host, merging, 0, states, ending=ending) for ending in Ending]
    assert [one.ending for one in to_be_scored(found)] == [Ending.SCORED, Ending.CENSORED]
    assert to_be_scored([Meeting(host, merging, 0, states[:1], ending=Ending.SCORED)]) == []


def test_nothing_to_score():
    scored, others = score([], encounters_of([], "000", "us101", "traffic"), Rules())
    assert all(len(values) == 0 for values in (*scored.columns.values(), *others.values()))

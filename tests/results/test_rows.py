"""Result rows: delay in closed form, order, labels and censoring by hand."""

import numpy as np
import pytest

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.encounter import Encounters, Ragged, ReplayLog
from merge_cosim.core.observation import Setting
from merge_cosim.results.rows import free_time, result_rows
from merge_cosim.scoring.decisions import GATES
from merge_cosim.simulation.loop import Effort, Run

SETTING = Setting(speed_limit=29.0)


def encounters(label=1, score_until=60, logged=50, **states):
    one = np.array
    track = Ragged.of([np.linspace(-50, 0, logged)])
    log = ReplayLog(track, track, track, one([logged - 1]), one([score_until]))
    text = {name: one([value]) for name, value in (("case", "c"), ("site", "us101"), ("source", "ngsim"), ("car", "k"))}
    numbers = {
        name: one([value])
        for name, value in {
            "host_station": -50.0,
            "host_speed": 29.0,
            "host_length": 5.0,
            "merging_station": -40.0,
            "merging_speed": 10.0,
            "merging_length": 5.0,
            "merge_position": 0.0,
            **states,
        }.items()
    }
    flags = {"smoothed_source": one([False]), "length_missing": one([False])}
    return Encounters(**text, **numbers, label=one([label]), **flags, log=log)


def row(case=None, **changed):
    columns = {
        "kind": 0,
        "scored_from": 20,
        "host_reached_s": 2.0,
        "merging_reached_s": 1.0,
        "goal_s": np.nan,
        "distance_m": 12.0,
        "gap_m": 7.0,
        "min_gap_m": np.inf,
        "min_ttc_s": np.inf,
        "hardest_braking": 1.0,
        "max_drac": 0.0,
        "jerk_sum": 9.8,
        "decision_flips": 2,
        "last_decision": 1,
        "decided_from": 7,
        **{f"{kind}_{gate}": np.nan for kind in ("log_odds", "arrival_lead") for gate in GATES},
        "host_cleared_s": np.nan,
        "merging_cleared_s": 1.5,
        "station_square_sum": 49.0 * 4.0,
        "speed_square_sum": 49.0 * 0.25,
        "sumo_collision": 0,
        "end_cycle": 50,
        "end_station": 20.0,
        "end_speed": 29.0,
        "end_merging_station": 40.0,
        "end_merging_speed": 10.0,
        "scored_to_end": True,
    } | changed
    case = case or encounters()
    run = Run(case, {name: np.array([value]) for name, value in columns.items()}, Effort(), "sumo")
    names = {"scenario": "s", "variation": "", "method": "m", "model": ""}
    return result_rows(run, case, SETTING, Acc(), names).to_pylist()[0]


def test_free_time_at_the_limit_is_way_over_speed():
    time = free_time(np.array([-50.0, 20.0, 50.0, 80.0]), np.full(4, 29.0), SETTING, Acc())
    np.testing.assert_allclose(time, [100 / 29, 30 / 29, 0.0, 0.0])


def test_free_time_from_standstill_follows_the_clipped_law():
    # full acceleration of 2 m/s^2 below 24 m/s; after k steps of 0.1 s the car has gone 0.01 k (k + 1) m
    time = free_time(np.array([49.0]), np.array([0.0]), SETTING, Acc())[0]
    way = [0.01 * k * (k + 1) for k in range(12)]
    whole = sum(1 for s in way[1:] if s < 1.0)
    part = (1.0 - way[whole]) / (way[whole + 1] - way[whole])
    assert time == pytest.approx(0.1 * (whole + part))


def test_delay_is_arrival_against_free_driving():
    assert row()["delay_s"] == pytest.approx(5.0 + 30 / 29 - 100 / 29)
    assert row(goal_s=4.0)["delay_s"] == pytest.approx(4.0 - 100 / 29)


def test_order_and_label():
    first = row()
    assert first["host_first"] is False
    assert first["label"] == "NOT_YIELD"
    assert first["correct_at_merge"] is True
    assert first["order_swapped"] is False
    swapped = row(host_reached_s=0.5, last_decision=0)
    assert swapped["host_first"] is True
    assert swapped["order_swapped"] is True
    assert swapped["correct_at_merge"] is False
    neither = row(host_reached_s=np.nan, merging_reached_s=np.nan)
    assert neither["host_first"] is None
    assert neither["host_reached"] is False
    assert row(host_reached_s=np.nan)["host_first"] is False
    assert row(case=encounters(host_station=1.0), host_reached_s=np.nan)["host_reached"] is True
    unlabelled = row(case=encounters(label=-1))
    assert (unlabelled["label"], unlabelled["correct_at_merge"], unlabelled["order_swapped"]) == ("", None, None)


@pytest.mark.parametrize(
    ("changed", "censored"),
    [
        ({}, False),
        ({"scored_to_end": False, "end_cycle": 60}, True),  # the log's scoring ended first
        ({"scored_to_end": False, "end_cycle": 60, "kind": 2}, False),  # a failure stands, whatever was cut
        ({"scored_to_end": False, "end_cycle": 40}, True),  # timed out within the horizon
        ({"scored_to_end": False, "end_cycle": 40, "scored_from": -1}, False),  # timed out before they met
    ],
)
def test_what_cannot_be_scored_to_the_end_is_censored(changed, censored):
    assert row(**changed)["censored"] is censored


@pytest.mark.parametrize(
    ("changed", "stuck"),
    [
        ({"scored_to_end": False, "end_cycle": 40, "scored_from": -1}, True),
        (
            {"scored_to_end": False, "end_cycle": 40, "scored_from": -1, "host_reached_s": 2.0},
            False,
        ),  # the other is late
        ({"scored_to_end": False, "end_cycle": 60, "scored_from": -1}, False),  # the log's scoring ended: censored
        ({"scored_to_end": False, "end_cycle": 40}, False),  # within the horizon: censored
        ({"scored_to_end": False, "end_cycle": 40, "kind": 4}, False),  # a failure stands
        ({}, False),  # the merging car alone was scored to the end
    ],
)
def test_a_host_that_has_not_arrived_in_time_is_stuck(changed, stuck):
    assert row(**{"host_reached_s": np.nan, **changed})["stuck"] is stuck


def test_a_run_past_the_logs_end_is_extended():
    assert row(end_cycle=49)["extended"] is False
    assert row(end_cycle=50)["extended"] is True


def test_missing_is_missing():
    nothing = row(distance_m=np.nan, gap_m=np.nan)
    assert [nothing[name] for name in ("distance_m", "gap_m", "min_gap_m", "min_ttc_s")] == [None] * 4
    assert [row(max_drac=drac)["max_drac"] for drac in (0.0, 2.0)] == [None, 2.0]


def test_post_encroachment_time_runs_from_the_first_rear_to_the_second_front():
    assert row()["pet_s"] == pytest.approx(2.0 - 1.5)
    behind = row(host_reached_s=0.5, host_cleared_s=0.9)  # the merging car second, at 1.0 s
    assert behind["pet_s"] == pytest.approx(1.0 - 0.9)
    # the run ends at 5.0 s with the merging car's rear 2 m before the point, at 10 m/s
    overlap = row(merging_cleared_s=np.nan, end_merging_station=3.0)
    assert overlap["pet_s"] == pytest.approx(2.0 - 5.2)
    standing = row(merging_cleared_s=np.nan, end_merging_station=3.0, end_merging_speed=0.0)
    assert standing["pet_s"] is None
    assert row(host_reached_s=np.nan)["pet_s"] is None
    on_its_way = row(case=encounters(host_station=1.0), host_reached_s=np.nan, host_cleared_s=0.2)
    assert on_its_way["pet_s"] == pytest.approx(1.0 - 0.2)  # its rear was still to come


def test_ambiguity_is_the_difference_of_the_times_to_arrival():
    assert row()["ambiguity_s"] == pytest.approx(40 / 10 - 50 / 29)
    assert row(case=encounters(merging_station=3.0))["ambiguity_s"] == pytest.approx(50 / 29)


def test_jerk_and_likeness_are_means_over_the_cycles():
    measured = row()
    assert measured["mean_jerk"] == pytest.approx(9.8 / 0.1 / 49)
    assert measured["human_station_rms_m"] == pytest.approx(2.0)  # the log has 49 cycles after its first
    assert measured["human_speed_rms"] == pytest.approx(0.5)
    assert row(end_cycle=1)["mean_jerk"] is None


def test_a_stable_decision_counts_only_if_it_is_right():
    assert row()["first_stable_s"] == pytest.approx(0.7)
    assert row(last_decision=0)["first_stable_s"] is None
    assert row(case=encounters(label=-1))["first_stable_s"] is None
    assert row(last_decision=-1)["decision_flips"] is None


def test_a_rules_certainty_stays_infinite():
    assert row(log_odds_40=-np.inf)["log_odds_40"] == -np.inf
    assert row()["log_odds_40"] is None

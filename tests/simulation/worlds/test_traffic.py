"""A method that drives the hosts of a running SUMO."""

import numpy as np
import pytest
from living import OTHERS, TYPES, drive, us101, vehicle

from merge_cosim.controllers.acc import Acc
from merge_cosim.core.observation import Setting
from merge_cosim.simulation.worlds.notes import Event

LIMIT = Setting().speed_limit


def test_a_host_alone_drives_freely(tmp_path):
    law, speeds = Acc(), []
    with us101(tmp_path, vehicle("h", "host", 100, 10)) as (api, driven):
        drive(api, driven, 80, lambda _: speeds.append(api.vehicle.getSpeed("h")))
    expected = [10.0]
    for _ in range(79):
        free = np.clip(law.free(expected[-1], LIMIT), law.min_acceleration, law.max_acceleration)
        expected.append(expected[-1] + 0.1 * free)
    np.testing.assert_allclose(speeds, expected, atol=1e-5)


def test_a_host_keeps_distance_to_its_leader_bumper_to_bumper(tmp_path):
    law, found = Acc(), []

    def each(_):
        api.vehicle.setSpeed("o", 12.0)
        gap = api.vehicle.getLanePosition("o") - 6.0 - api.vehicle.getLanePosition("h")
        found.append((gap, api.vehicle.getSpeed("h"), api.vehicle.getSpeed("o")))

    cars = (vehicle("o", "other", 160, 12), vehicle("h", "host", 100, 20))
    with us101(tmp_path, *cars) as (api, driven):
        drive(api, driven, 150, each)
    gap, speed, leader = np.array(found).T
    keep = law.clip(np.minimum(law.follow(gap, speed, leader), law.free(speed, LIMIT)))
    np.testing.assert_allclose(np.diff(speed), 0.1 * keep[:-1], atol=1e-5)
    assert gap.min() > 0
    assert gap[-1] == pytest.approx(law.d0 + law.headway * 12.0, abs=0.5)


def beside(tmp_path, merging_position, method="always-go", **options):
    """A host 60 m before the gore and a merging car, which changes lane 30 m past the gore."""
    cars = (vehicle("h", "host", 440, 20), vehicle("m", "merging", merging_position, 20, route="ramp"))
    with us101(tmp_path, *cars, method=method, **options) as (api, driven):
        api.simulationStep()
        api.vehicle.setSpeedMode("m", 32)
        api.vehicle.setLaneChangeMode("m", 0)
        driven.cycle()

        def each(_):
            if "m" in api.vehicle.getIDList():
                api.vehicle.setSpeed("m", 20.0)
                if api.vehicle.getLaneID("m") == "weave_0" and api.vehicle.getLanePosition("m") >= 30.0:
                    api.vehicle.changeLane("m", 1, 0.0)

        drive(api, driven, 300, each)
        return driven.close(), driven.world


def test_an_encounter_is_recorded_as_sumo_has_it(tmp_path):
    run, world = beside(tmp_path, 420)
    (meeting,) = world.kept
    (seen,) = run.traces.values()
    assert seen["host_x_m"][0] == -60.0
    assert seen["merging_x_m"][0] == -80.0
    np.testing.assert_allclose(np.diff(seen["merging_x_m"])[1:], 2.0, atol=1e-5)  # SUMO drove the first step
    np.testing.assert_allclose(np.diff(seen["host_x_m"]), 0.1 * seen["host_speed_m_s"][1:], atol=1e-5)
    assert 30.0 <= meeting.merge_position < 34.1
    merged = meeting.merged_at - meeting.begun
    assert seen["merging_x_m"][merged] == meeting.merge_position
    assert seen["merging_station_m"][merged] == 0.0
    follower = seen["host_x_m"] - 4.0 - seen["merging_x_m"]  # the host is ahead
    np.testing.assert_allclose(seen["follower_gap_m"][merged:], follower[merged:], atol=1e-5)
    both = np.flatnonzero(seen["host_x_m"] >= meeting.merge_position)
    assert run.columns["end_cycle"].tolist() == [max(both[0], merged) + 30] == [len(seen)]
    assert run.columns["scored_to_end"].tolist() == [True]
    assert run.columns["cut_off"].tolist() == [False]
    assert run.encounters.host_station[0] == pytest.approx(-60.0 - meeting.merge_position)


def test_a_host_that_yields_lets_the_car_in_ahead_of_it(tmp_path):
    gone, yielded = (next(iter(beside(tmp_path, 440, m)[0].traces.values())) for m in ("always-go", "always-yield"))
    assert gone["host_x_m"].iloc[-1] > gone["merging_x_m"].iloc[-1]
    assert yielded["host_x_m"].iloc[-1] < yielded["merging_x_m"].iloc[-1]
    assert yielded["host_speed_m_s"].min() < gone["host_speed_m_s"].min()


def test_what_leaves_the_lane_before_the_horizon_is_cut_off(tmp_path):
    run, _ = beside(tmp_path, 440, horizon=35.0)
    assert run.columns["cut_off"].tolist() == [True]
    assert run.columns["scored_to_end"].tolist() == [False]


def test_standing_counts_before_the_lane_change(tmp_path):
    cars = (vehicle("h", "host", 440, 20), vehicle("m", "merging", 420, 0, route="ramp"))
    with us101(tmp_path, *cars) as (api, driven):
        drive(api, driven, 60, lambda _: api.vehicle.setSpeed("m", 0.0))
        run = driven.close()
    assert driven.world.stopped == 1
    assert len(run.encounters) == 0
    assert all(len(values) == 0 for values in run.columns.values())  # nothing to score


def test_a_car_that_stood_beside_the_host_was_not_in_the_lane_yet(tmp_path):
    """It changes lane where it stands, once the host has passed it: no overlap."""
    cars = (vehicle("h", "host", 380, 20), vehicle("m", "merging", 440, 20, route="ramp"))
    with us101(tmp_path, *cars) as (api, driven):
        api.simulationStep()
        api.vehicle.setSpeedMode("m", 32)
        api.vehicle.setLaneChangeMode("m", 0)
        driven.cycle()

        def each(_):
            there = api.vehicle.getLaneID("m") != "ramp_0" and api.vehicle.getLanePosition("m") >= 30.0
            api.vehicle.setSpeed("m", 0.0 if there else 20.0)
            if api.vehicle.getPosition("h")[0] > api.vehicle.getPosition("m")[0] + 20.0:
                api.vehicle.changeLane("m", 1, 0.0)

        drive(api, driven, 80, each)
        run = driven.close()
    assert run.columns["merging_stopped"].tolist() == [True]
    assert run.columns["kind"].tolist() == [0]
    assert run.columns["min_gap_m"][0] > 10.0


def test_the_more_binding_of_leader_and_merging_car_counts(tmp_path):
    """With a leader close ahead the host drives no faster than without, in any cycle."""
    speeds = {}
    for close in (False, True):
        cars = [vehicle("h", "host", 400, 20), vehicle("m", "merging", 410, 20, route="ramp")]
        cars += [vehicle("o", "other", 430, 14)] if close else []
        found = []
        with us101(tmp_path, *cars, method="always-yield") as (api, driven):

            def each(_, api=api, found=found, close=close):
                api.vehicle.setSpeed("m", 20.0)
                if close:
                    api.vehicle.setSpeed("o", 14.0)
                found.append(api.vehicle.getSpeed("h"))

            drive(api, driven, 40, each)
        speeds[close] = np.array(found)
    assert (speeds[True] <= speeds[False] + 1e-9).all()
    assert speeds[True][-1] < speeds[False][-1] - 1.0


def test_several_merging_cars_in_a_row_are_met_each(tmp_path):
    cars = [vehicle("h", "host", 410, 18)]
    cars += [vehicle(f"m{i}", "merging", position, 18, route="ramp") for i, position in enumerate((450, 425, 400))]
    with us101(tmp_path, *cars, method="acc") as (api, driven):
        drive(api, driven, 300)
        run = driven.close()
    assert set(run.traces) == {"000/h/m0", "000/h/m1", "000/h/m2"}
    assert len({trace["time_s"][0] for trace in run.traces.values()}) == 1


def test_cars_on_the_ramp_are_merging_cars_where_no_type_says_so(tmp_path):
    cars = (vehicle("h", "other", 430, 20), vehicle("m", "other", 420, 20, route="ramp"))
    with us101(tmp_path, *cars, types=OTHERS, host="h") as (api, driven):
        drive(api, driven, 3)
        assert list(driven.close().traces) == ["000/h/m"]


def noted(driven, event):
    return [line for kind, line in driven.world.notes.lines if kind is event]


def test_two_hosts_that_meet_one_car_are_noted(tmp_path):
    cars = (
        vehicle("h1", "host", 440, 20),
        vehicle("h2", "host", 400, 20),
        vehicle("m", "merging", 420, 20, route="ramp"),
    )
    with us101(tmp_path, *cars) as (api, driven):
        drive(api, driven, 3)
        run = driven.close()
    assert noted(driven, Event.TWO_HOSTS) == ["merging car m meets two hosts at once, h1 and h2"]
    assert len(run.traces) == 2


def test_more_meetings_than_a_block_has_slots(tmp_path, monkeypatch):
    """Each meeting goes on as it would with room for all."""
    cars = [vehicle("h", "host", 410, 18)]
    cars += [vehicle(f"m{i}", "merging", position, 18, route="ramp") for i, position in enumerate((450, 425, 400))]
    found = []
    for slots in (32, 2):
        monkeypatch.setattr("merge_cosim.simulation.worlds.traffic.BLOCK", slots)
        with us101(tmp_path, *cars, method="slot-time") as (api, driven):
            drive(api, driven, 200)
            found.append(driven.close().traces)
    assert set(found[0]) == {"000/h/m0", "000/h/m1", "000/h/m2"}
    for name, trace in found[0].items():
        assert trace.equals(found[1][name]), name


def test_a_host_beside_its_lane_is_noted_and_meets_nobody(tmp_path):
    cars = (vehicle("h", "host", 400, 20, lane=2), vehicle("m", "merging", 400, 20, route="ramp"))
    with us101(tmp_path, *cars) as (api, driven):
        drive(api, driven, 100)
        run = driven.close()
    assert len(noted(driven, Event.HOST_OFF_LANE)) == 1
    assert run.traces == {}


def test_sumo_drives_a_host_where_the_method_does_not(tmp_path):
    """In the host lane the method drives, up to the edge on which the route leaves it; elsewhere SUMO does."""
    leaving = '<route id="leaving" edges="main_in weave exit"/>'
    cars = (
        vehicle("h", "host", 300, 20, route="leaving"),
        vehicle("b", "host", 300, 20, lane=3),
    )
    seen, speeds, lanes = {"h": [], "b": []}, [], []
    with us101(tmp_path, *cars, types=TYPES + leaving) as (api, driven):

        def each(_):
            for name, found in seen.items():
                if name in api.vehicle.getIDList():
                    found.append((api.vehicle.getLaneID(name), api.vehicle.getSpeedMode(name) == 32))
            lanes.append(api.vehicle.getLaneID("h") if "h" in api.vehicle.getIDList() else "")
            speeds.append(api.vehicle.getSpeed("b"))

        drive(api, driven, 250, each)
    assert dict(seen["h"][2:110])["main_in_0"]
    assert "exit_0" in lanes  # SUMO brought it there: the host lane does not lead to the exit
    assert not dict(seen["h"])["exit_0"]
    assert not any(by_method for lane, by_method in seen["b"] if lane == "main_in_3")
    assert speeds[50] > 20.0


def test_no_host_at_all_is_noted(tmp_path):
    with us101(tmp_path, vehicle("m", "merging", 400, 20, route="ramp"), host="merging") as (api, driven):
        drive(api, driven, 3)
        driven.close()
    assert len(noted(driven, Event.NO_HOST)) == 1
    assert driven.world.notes.counts()["without_host"] == 1


def test_a_host_that_never_departs_is_noted(tmp_path):
    late = vehicle("h", "host", 300, 20).replace('insertionChecks="none"', "")
    cars = (vehicle("o", "other", 300, 0, more='speedFactor="0.0001"'), late)
    with us101(tmp_path, *cars) as (api, driven):
        drive(api, driven, 5, lambda _: api.vehicle.setSpeed("o", 0.0))
        driven.close()
    assert noted(driven, Event.HOST_NOT_DEPARTED) == ["host h never departed: no room where it was to enter"]
    assert driven.world.host_count == 0


def test_contacts_are_noted_once_each(tmp_path):
    cars = (
        vehicle("h", "host", 300, 20),
        vehicle("o1", "other", 200, 20, lane=3),
        vehicle("o2", "other", 203, 20, lane=3),
    )
    with us101(tmp_path, *cars) as (api, driven):

        def each(_):
            for name in ("o1", "o2"):
                api.vehicle.setSpeedMode(name, 32)
                api.vehicle.setSpeed(name, 20.0)

        drive(api, driven, 5, each)
    assert noted(driven, Event.OTHER_CONTACT) == ["SUMO reports a contact of o1 and o2 on lane main_in_3"]
    assert driven.world.notes.counts()["host_contacts"] == 0


def test_teleports_are_noted(tmp_path):
    cars = (vehicle("o", "other", 200, 0, lane=4), vehicle("behind", "other", 190, 0, lane=4))
    with us101(tmp_path, *cars, time_to_teleport="2") as (api, driven):

        def each(cycle):
            if cycle < 2:
                api.vehicle.setLaneChangeMode("behind", 0)
                api.vehicle.setSpeed("o", 0.0)

        drive(api, driven, 60, each)
    assert noted(driven, Event.TELEPORT) == ["vehicle o was teleported by SUMO"]


def test_a_car_past_the_merging_point_may_come_in_up_to_the_end_of_its_lane(tmp_path):
    found = []
    cars = (vehicle("h", "host", 480, 15), vehicle("m", "merging", 490, 15, route="ramp"))
    with us101(tmp_path, *cars) as (api, driven):
        api.simulationStep()
        api.vehicle.setLaneChangeMode("m", 0)
        driven.cycle()

        def each(_):
            if api.vehicle.getLaneID("m") == "weave_0":
                found.append((driven.world._around[1, 0], driven.world.room[0]))

        drive(api, driven, 150, each)
    x, room = np.array(found).T
    assert x.min() < 42.0 - 20.0 < 213.0 - 20.0 < x.max()
    np.testing.assert_allclose(room, np.where(x < 42.0, 0.0, np.maximum(213.0 - x, 1e-6)), atol=1e-5)

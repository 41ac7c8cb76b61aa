"""Full-scene replay: the pairs of a replay among all logged cars, and what differs from the pairs alone."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from trajectory_tables import Car, steady, table

from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.pairing.pairs import extract_pairs
from merge_cosim.ngsim.pairing.recordings import scenes_of
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.tracks import build_tracks
from merge_cosim.ngsim.sites import site
from merge_cosim.results.parts import SCENE_FACTS
from merge_cosim.scenarios.logged_scenes import load_scenes
from merge_cosim.scenarios.methods import Method
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.simulation.worlds.logged_rules import FullScene
from merge_cosim.sweeps.cases import LoggedCases, PairCases
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession

US101 = site("us101")

AROUND = ("min_leader_gap_m", "min_leader_ttc_s", "min_follower_gap_m")
METHODS = ("acc", "slot", "pgm", "fg", "ipcb", "always-go", "always-yield", "acc+brake")


def wavy(vehicle: int, lanes: list[int], at: float, speed: float, phase: float, **more: Any) -> Car:
    """A car whose speed swings by 3 m/s."""
    speeds = speed + 3.0 * np.sin(phase + 0.06 * np.arange(len(lanes)))
    return Car(vehicle, lanes, at + np.cumsum(speeds) * 0.1, **more)


HOST = wavy(1, [5] * 250, at=-20, speed=13, phase=0.0)
MERGING = wavy(2, [7] * 40 + [6] * 60 + [5] * 150, at=-30, speed=14, phase=2.0)
BESIDE = [steady(10 + k, [lane] * 250, at=-140.0 + 25 * k, speed=15) for k, lane in enumerate((1, 2, 3, 4, 4, 3, 2))]


def batches(*cars: Car, method: str = "acc", host: str = "-h1.1", **settings: Any) -> tuple[Task, Task]:
    """The pair of cars 1 and 2, or that of other hosts, alone and among all cars."""
    logged = table(*cars)
    pairs = extract_pairs(logged, US101, PairRules(), "ngsim").encounters
    pairs = pairs.take(np.flatnonzero([name.endswith(host) for name in pairs.case]))
    scenes = scenes_of(build_tracks(logged, US101, PairRules(), everywhere=True), US101, PairRules())
    scenario = load_scenario("us101-scene", {f"full_scene.{name}": value for name, value in settings.items()})
    chosen = Method.of(method)
    model = IntentionModel.load("us101-ngsim") if chosen.needs_model else None
    assert scenario.full_scene is not None
    kinds = (PairCases(pairs), LoggedCases.of(pairs, scenario.full_scene, scenes))
    alone, among = (Task(scenario=scenario, cases=cases, method=chosen, model=model) for cases in kinds)
    return alone, among


def row_of(batch: Task) -> dict[str, Any]:
    worker_session = WorkerSession()
    rows = batch.run(worker_session)[0]
    worker_session.close()
    (row,) = rows.to_pylist()
    return row


def facts_of(batch: Task) -> tuple[dict[str, Any], dict[str, Any]]:
    """The result row and the scene's facts."""
    rows = batch.run(WorkerSession())[0]
    (facts,) = json.loads(rows.schema.metadata[SCENE_FACTS])
    return rows.to_pylist()[0], facts


def assert_same(one: dict[str, Any], other: dict[str, Any], leave_out: tuple[str, ...] = ()) -> None:
    for name in one.keys() - {*AROUND, *leave_out}:
        expected = pytest.approx(one[name], abs=1e-6) if isinstance(one[name], float) else one[name]
        assert other[name] == expected, name


@pytest.mark.parametrize("method", METHODS)
def test_with_nobody_in_the_lane_the_row_is_that_of_the_pair_alone(method: str) -> None:
    alone, among = batches(HOST, MERGING, *BESIDE, method=method)
    row = row_of(among)
    assert_same(row_of(alone), row)
    assert [row[name] for name in AROUND] == [None, None, None]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("cut", ["merging", "host"])
def test_where_a_log_ends_all_goes_on_as_for_the_pair_alone(method: str, cut: str) -> None:
    host = wavy(1, [5] * (103 if cut == "host" else 250), at=-20, speed=13, phase=0.0)
    merging = wavy(2, ([7] * 40 + [6] * 60 + [5] * 150)[: 107 if cut == "merging" else 250], -30, 14, 2.0)
    alone, among = batches(host, merging, *BESIDE, method=method)
    row = row_of(among)
    assert_same(row_of(alone), row)
    assert row["extended"] or cut == "host"


LEADER = steady(3, [5] * 250, at=-6, speed=12)


def test_the_host_keeps_distance_to_its_logged_leader() -> None:
    alone, among = batches(HOST, MERGING, LEADER, *BESIDE, method="always-go")
    row = row_of(among)
    assert row["min_leader_gap_m"] > 5.0
    assert row["min_leader_ttc_s"] > 1.0
    assert row["delay_s"] > row_of(alone)["delay_s"] + 0.5
    assert row["failure_kind"] != "host_into_leader"


def test_a_host_that_does_not_heed_its_leader_fails_by_it_and_is_else_the_pairs() -> None:
    alone, among = batches(HOST, MERGING, LEADER, *BESIDE, method="always-go", heed_leader=False)
    row, of_pair = row_of(among), row_of(alone)
    assert_same(of_pair, row, leave_out=("failed", "failure_kind", "censored"))
    assert not of_pair["failed"]
    assert (row["failure_kind"], row["failed"]) == ("host_into_leader", True)
    assert row["min_leader_gap_m"] < 0


FOLLOWERS = [steady(20 + k, [5] * 250, at=-20.0 - 18 * (k + 1), speed=13) for k in range(3)]


def test_logged_cars_drive_through_a_host_that_stops_unless_they_are_released() -> None:
    row, facts = facts_of(batches(HOST, MERGING, *FOLLOWERS, method="acc+brake")[1])
    assert row["min_follower_gap_m"] < 0
    assert (facts["driven_through"], facts["released"], facts["cars"]) == (3, 0, 5)
    assert facts["notes"][0] == ["driven_through", "logged car 20.1 drove into host 1.1"]
    row, facts = facts_of(batches(HOST, MERGING, *FOLLOWERS, method="acc+brake", others="released")[1])
    assert row["min_follower_gap_m"] > 0
    assert (facts["driven_through"], facts["released"]) == (0, 3)


def test_a_released_car_that_the_merging_car_drives_into_is_reported() -> None:
    x = -5.0 + np.cumsum(np.where(np.arange(120) < 10, 7.0, 25.0)) * 0.1
    slow = Car(31, [6 if at < 205 else 8 for at in x], x)  # in its log it makes way
    how = {"others": "released", "drivers.accel": 0.1}
    facts = facts_of(batches(HOST, MERGING, slow, method="always-yield", **how)[1])[1]
    assert (facts["released"], facts["other_contacts"]) == (1, 1)
    assert ["other_contacts", "SUMO reports a contact of 2.1 and 31.1"] in facts["notes"]
    assert facts_of(batches(HOST, MERGING, slow, method="always-yield")[1])[1]["other_contacts"] == 0


def test_before_the_take_over_the_host_is_the_human() -> None:
    cars = (HOST, MERGING, LEADER, *FOLLOWERS)
    among = batches(*cars, method="always-yield", take_over=1000.0)[1]
    human = batches(*cars, method="human")[1]
    decided = ("method", "world", "decision_flips", "correct_at_merge", "first_stable_s", "sumo_collision")
    beliefs = tuple(name for name in row_of(human) if name.startswith(("log_odds", "arrival_lead")))
    row = row_of(among)
    assert_same(row_of(human), row, leave_out=(*decided, *beliefs))
    assert row["human_station_rms_m"] == pytest.approx(0.0, abs=1e-6)
    half = row_of(batches(*cars, method="always-yield", take_over=3.0)[1])
    whole = row_of(batches(*cars, method="always-yield")[1])
    assert 0.01 < half["human_station_rms_m"] < whole["human_station_rms_m"]


def test_real_pairs_have_the_rows_of_the_pair_test_when_the_leader_is_not_heeded(data_dir: Path) -> None:
    request = SweepRequest(["us101-replay"], ["acc", "pgm"], data=data_dir)
    scenes, worker_session = None, WorkerSession()
    for batch in plan(request):
        scenario = load_scenario("us101-scene", {"full_scene.heed_leader": False})
        scenes = scenes or load_scenes(scenario, "ngsim", data_dir)
        few = batch.take(np.arange(0, len(batch), 6))
        alone = few.run(worker_session)[0]
        assert scenario.full_scene is not None
        assert few.cases.encounters is not None
        cases = LoggedCases.of(few.cases.encounters, scenario.full_scene, scenes)
        among = replace(few, scenario=scenario, cases=cases).run(worker_session)[0]
        for one, other in zip(alone.to_pylist(), among.to_pylist(), strict=True):
            left_out = ("scenario", "sumo_collision")
            if other["failure_kind"] == "host_into_leader":
                assert other["min_leader_gap_m"] < 0
                left_out += ("failed", "failure_kind", "censored")
            assert_same(one, other, left_out)
    worker_session.close()


def test_a_case_does_not_feel_the_others_of_its_batch() -> None:
    batch, among = batches(HOST, MERGING, LEADER, *FOLLOWERS, *BESIDE, method="pgm", others="released", host="")
    assert len(batch) == 2
    whole = among.run(WorkerSession())[0].to_pylist()
    assert whole[0]["distance_m"] != whole[1]["distance_m"]
    for order in ([0], [1], [1, 0]):
        rows = among.take(np.array(order)).run(WorkerSession())[0].to_pylist()
        assert rows == [whole[number] for number in order]


def test_a_part_has_its_own_scene_and_the_digest_sees_all_cars() -> None:
    among = batches(HOST, MERGING, *BESIDE)[1]
    assert len(among.part(0, 1).cases.places) == len(among.take(np.array([0, 0])).cases.places) / 2 == 1
    assert among.part(0, 0).cases.places == ()
    assert among.digest() == batches(HOST, MERGING, *BESIDE)[1].digest()
    assert among.digest() != batches(HOST, MERGING, *BESIDE[1:])[1].digest()
    assert isinstance(among.run(WorkerSession())[0], pa.Table)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("designed-1", {"full_scene.others": "log"}, "full_scene needs logged cars"),
        ("us101-scene", {"encounters.merge_point": "site"}, "full_scene needs encounters.merge_point = 'car'"),
        ("us101-scene", {"full_scene.others": "gone"}, "full_scene.others = 'gone'"),
        ("us101-scene", {"full_scene.take_ovr": 1}, "unknown key 'full_scene.take_ovr'; did you mean 'take_over'"),
        ("us101-scene", {"full_scene.drivers.tua": 1}, "unknown key 'full_scene.drivers.tua'; did you mean 'tau'"),
        ("us101-scene", {"full_scene.take_over": -1}, "full_scene.take_over = -1"),
    ],
)
def test_what_makes_no_full_scene_is_refused(name: str, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError) as refused:
        load_scenario(name, settings)
    assert message in str(refused.value)


def test_a_pair_without_a_scene_is_reported() -> None:
    batch, _ = batches(HOST, MERGING)
    with pytest.raises(UserError, match="no scene holds the pair"):
        LoggedCases.of(batch.cases.encounters, FullScene(), {})

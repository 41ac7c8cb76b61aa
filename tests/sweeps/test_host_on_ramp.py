"""The host on the ramp: the mirror image of the host on the main road."""

import libsumo
import numpy as np
import pandas as pd
import pytest

from merge_cosim.core.encounter import Intention
from merge_cosim.core.errors import UserError
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession


def tasks(scenario: str, host: str, methods: tuple[str, ...], cases: int = 60, world="sumo", **settings) -> list[Task]:
    """An evenly spaced part of a scenario."""
    values = {"host": host} | {name.replace("__", "."): value for name, value in settings.items()}
    how = {"settings": values, "world": world, "source": "surrogate", "model": "us101-ngsim"}
    found = plan(SweepRequest([scenario], methods, **how))
    return [task.take(np.unique(np.linspace(0, len(task) - 1, cases).astype(int))) for task in found]


def rows(task: Task, session: WorkerSession) -> pd.DataFrame:
    return task.run(session)[0].to_pandas().drop(columns="sumo_collision")


@pytest.mark.parametrize("scenario", ["designed-2", "designed-3"])
@pytest.mark.parametrize("ramp", ["designed", "us101"])
def test_a_symmetric_scenario_gives_mirrored_results(scenario, ramp):
    methods, session = ("acc", "pgm"), WorkerSession()
    on_main = [rows(task, session) for task in tasks(scenario, "main", methods, ramp=ramp)]
    on_ramp = [rows(task, session) for task in tasks(scenario, "ramp", methods, ramp=ramp)]
    session.close()
    for one, other in zip(on_main, on_ramp, strict=True):
        pd.testing.assert_frame_equal(one, other, check_exact=False, rtol=0, atol=1e-4)


@pytest.mark.parametrize("ramp", ["designed", "us101"])
def test_the_host_drives_on_the_ramp_and_changes_lane(ramp):
    (task,) = tasks("designed-2", "ramp", ("acc",), cases=3, ramp=ramp)
    session = WorkerSession()
    world = session.world(task.ramp, 3, 0, task.scenario.host)
    task.simulate(world)  # whose cars are then where they ended
    road = task.ramp
    edges = {car: libsumo.vehicle.getRoute(f"{car}.0") for car in ("host", "merging")}
    assert edges == {
        "host": tuple(f"t0.{edge}" for edge in road.ramp_route),
        "merging": tuple(f"t0.{edge}" for edge in road.main_route),
    }
    lanes = {libsumo.vehicle.getLaneID(f"{car}.0") for car in ("host", "merging")}
    assert lanes <= {f"t0.{section.edge}_{section.lane}" for section in road.main}
    session.close()


def test_replay_swaps_the_logged_cars():
    (main,), (ramp,) = (
        tasks("us101-replay", host, ("human",), cases=40, world="closed-form") for host in ("main", "ramp")
    )
    one, other = main.cases.encounters, ramp.cases.encounters
    np.testing.assert_array_equal(one.host_station, other.merging_station)
    np.testing.assert_array_equal(one.log.merging_speed.values, other.log.host_speed.values)
    np.testing.assert_array_equal(one.label == Intention.YIELD, other.label == Intention.NOT_YIELD)
    assert one.digest == other.swapped().digest
    there, here = rows(main, WorkerSession()), rows(ramp, WorkerSession())
    for name, mirrored in {
        "failed": "failed",
        "min_gap_m": "min_gap_m",
        "host_reached_s": "merging_reached_s",
        "merging_reached_s": "host_reached_s",
    }.items():
        pd.testing.assert_series_equal(there[name], here[mirrored], check_names=False, atol=2e-6)
    first = there["host_first"].notna()
    assert (there["host_first"][first] != here["host_first"][first]).all()


def test_every_method_replays_against_the_car_on_the_main_road():
    session = WorkerSession()
    for task in tasks("us101-replay", "ramp", ("acc", "pgm", "slot"), cases=10):
        run = task.run(session)[0].to_pandas()
        log = task.cases.encounters.log
        assert log is not None
        ((traced, _),) = task.part(0, 1).runs(session, traced={task.case(0)})
        trace = traced.traces[task.case(0)]["merging_station_m"].to_numpy()
        logged = log.merging_station[0][: len(trace)]
        np.testing.assert_allclose(trace[: len(logged)], logged, atol=2e-6)
        assert run["host_reached"].any()
    session.close()


@pytest.mark.parametrize(
    ("scenario", "settings", "message"),
    [
        ("traffic-light", {}, "host = 'ramp' is for two cars alone"),
        ("us101-scene", {}, "host = 'ramp' is for two cars alone"),
        ("designed-2", {"test__overlap_from": "lane_change"}, "test.overlap_from must be 'both'"),
        ("designed-2", {"host": "left"}, "host = 'left': Input should be 'main' or 'ramp'"),
    ],
)
def test_what_does_not_fit_is_refused(scenario, settings, message):
    with pytest.raises(UserError, match=message):
        tasks(scenario, **{"host": "ramp", "methods": ("acc",)} | settings)

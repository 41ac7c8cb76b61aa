"""Pairs in the closed form: the outcomes of SUMO, whatever the batch; and what needs SUMO is refused."""

import numpy as np
import pandas as pd
import pytest

from merge_cosim.controllers.rollout import Rollout
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT
from merge_cosim.estimators.interactive import Interactive
from merge_cosim.estimators.pgm import Pgm
from merge_cosim.scenarios.random_states import RandomStates
from merge_cosim.simulation import loop
from merge_cosim.sweeps.closed_form_cases import RECORD_BYTES, ClosedFormCases
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.single import case_alone, trace_case
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession

METHODS = ("acc", "slot", "pgm", "fg", "dbn-pf")


def tasks(scenario: str, world: str, cases: int, methods=METHODS, **request) -> list[Task]:
    """An evenly spaced part of a scenario."""
    found = plan(SweepRequest([scenario], methods, world=world, **request))
    return [task.take(np.unique(np.linspace(0, len(task) - 1, cases).astype(int))) for task in found]


def rows(task: Task, session: WorkerSession, size: int | None = None) -> pd.DataFrame:
    """The result rows of a task that is run in parts of `size` cases."""
    size = size or len(task)
    parts = [task.part(first, min(first + size, len(task))) for first in range(0, len(task), size)]
    return pd.concat([part.run(session)[0].to_pandas() for part in parts], ignore_index=True)


@pytest.mark.parametrize(
    ("scenario", "request_"),
    [("designed-2", {}), ("designed-3", {}), ("us101-replay", {"source": "surrogate", "model": "us101-ngsim"})],
)
def test_the_closed_form_ends_as_sumo_does(scenario, request_):
    session = WorkerSession()
    for closed, sumo in zip(
        tasks(scenario, "closed-form", 60, **request_), tasks(scenario, "sumo", 60, **request_), strict=True
    ):
        assert isinstance(closed.cases, ClosedFormCases)
        one, other = rows(closed, session), rows(sumo, session)
        assert set(one.pop("world")) == {"closed-form"}
        assert set(other.pop("world")) == {"sumo"}
        assert not one.pop("sumo_collision").any()
        other.pop("sumo_collision")
        pd.testing.assert_frame_equal(one, other, check_exact=False, rtol=0, atol=1e-4)
    session.close()


def test_batches_do_not_matter():
    session = WorkerSession()
    for task in tasks("designed-2", "closed-form", 120, ("acc", "pgm", "dbn-pf")):
        whole = rows(task, session)
        for size in (7, 64):
            pd.testing.assert_frame_equal(whole, rows(task, session, size), check_exact=True)
    session.close()


def test_a_long_time_out_leaves_fewer_side_by_side_and_the_rows_as_they_are():
    (usual,) = tasks("designed-random", "closed-form", 300, ("acc",))
    (long,) = tasks("designed-random", "closed-form", 300, ("acc",), settings={"test.time_out": 3600})
    assert isinstance(long.cases, ClosedFormCases)
    assert long.cases.side_by_side * 3600 / DT * 6 * 8 <= RECORD_BYTES
    assert long.cases.side_by_side < 300
    session = WorkerSession()
    pd.testing.assert_frame_equal(rows(usual, session), rows(long, session), check_exact=True)


def test_random_states_are_drawn_beforehand_only_where_the_ramp_has_no_room_for_some():
    def planned(lowest: float) -> Task:
        settings = {"encounters.count": 300, "encounters.host_offset": {"from": lowest, "to": 5}}
        (task,) = plan(SweepRequest(["designed-random"], ["acc"], world="closed-form", settings=settings))
        return task

    usual, wide = planned(-5.0), planned(-600.0)
    assert isinstance(usual.cases.pairs, RandomStates)
    assert isinstance(wide.cases.pairs, Encounters)
    assert (len(usual), usual.left_out) == (300, ())
    assert 0 < len(wide.left_out) < 300
    assert len(wide) + len(wide.left_out) == 300


def test_a_case_alone_ends_as_in_its_batch():
    (task,) = tasks("designed-2", "closed-form", 50, ("pgm",))
    batch = task.run(WorkerSession())[0].to_pylist()
    row, trace = trace_case(case_alone([task], task.case(31)), task.case(31))
    assert row == batch[31]
    assert len(trace) == round(row["end_s"] / 0.1)


@pytest.mark.parametrize(("scenario", "why"), [("traffic-dense", "traffic"), ("us101-scene", "full_scene")])
def test_what_needs_other_cars_is_refused(scenario, why):
    with pytest.raises(UserError, match=rf"scenario {scenario}: {why} needs SUMO .*; leave out --world closed-form"):
        plan(SweepRequest([scenario], ["acc"], world="closed-form", source="surrogate"))


def test_a_window_is_refused():
    (task,) = tasks("designed-2", "closed-form", 1, ("acc",))
    with pytest.raises(UserError, match="--gui: not with --world closed-form"):
        trace_case(task, task.case(0), gui_delay=0)


@pytest.mark.parametrize("method", ["acc", "pgm", "fg", "ipcb", "slot+lqr", "always-go"])
def test_leaving_out_what_is_over_changes_no_row(method, monkeypatch):
    (task,) = plan(SweepRequest(["designed-random"], [method], settings={"encounters.count": 150}, world="closed-form"))
    thin, thinned = loop.Loop._thin, []
    monkeypatch.setattr(loop.Loop, "_thin", lambda self: (thinned.append(len(self._age)), thin(self)))
    expected, _ = task.run(WorkerSession())
    assert not thinned
    monkeypatch.setattr(loop, "THINNED_FROM", 10)
    rows, _ = task.run(WorkerSession())
    assert len(thinned) > 2
    assert rows.equals(expected)


def test_what_holds_more_than_it_names_is_not_thinned():
    class Mine(Pgm):
        """A user's."""

    assert Pgm().can_thin
    assert not Mine().can_thin
    assert not Rollout().can_thin  # of `Acc`, which holds nothing
    assert not Interactive().can_thin

"""Which cases are recorded, and that a record is that of the case run alone."""

import json

import numpy as np
import pandas as pd
import pytest

import merge_cosim as mc
from merge_cosim.controllers.rollout import POLICIES
from merge_cosim.report.trace_data import MOST_CYCLES, fitting
from merge_cosim.sweeps.traces import choose

SMALL = {"encounters.host_speed.step": 10, "encounters.merging_speed.step": 10, "encounters.host_offset.step": 5}
NAMES = ["scenario", "case", "method"]


def swept(out, methods=("acc", "interactive", "always-go"), **more):
    how = {"settings": SMALL, "world": "closed-form", "jobs": 1, "progress": False}
    return mc.sweep("designed-2", methods and list(methods), out=out, **(how | more))


def recorded(results):
    return set(results.traces[NAMES].drop_duplicates().itertuples(index=False, name=None))


def rows(**failing):
    """Rows of cases that fail under the named methods; of the last case, the distances differ most."""
    found = [(case, method, method in bad) for case, bad in failing.items() for method in ("a", "b", "c", "always-go")]
    frame = pd.DataFrame(found, columns=["case", "method", "failed"])
    return frame.assign(stuck=False, distance_m=np.arange(len(frame), dtype=float) ** 2)


@pytest.mark.parametrize(
    ("wanted", "cases"),
    [
        (None, ["both"]),  # a few: one of seven
        ("telling", ["both", "one", "too", "one_too"]),  # each set of methods once, then again
        ("failed", ["both", "one", "too", "one_too", "every"]),
        (5, ["both", "one", "too", "one_too", "none_too"]),
        ("all", ["both", "one", "too", "one_too", "none_too", "every", "none"]),
    ],
)
def test_cases_of_disagreement_come_first_one_of_each_kind(wanted, cases):
    every = ["a", "b", "c"]
    data = rows(one=["a"], one_too=["a"], none=["always-go"], every=every, too=["b"], none_too=[], both=["b", "c"])
    data.loc[data["case"] == "one", "distance_m"] += [0, 0, 1e4, 0]
    data.loc[data["case"] == "both", "distance_m"] += [0, 0, 1e6, 0]
    halves = [data[data["case"] < "o"], data[data["case"] >= "o"]]
    assert choose(halves, wanted) == choose([data], wanted) == cases


def test_traces_are_added_to_a_finished_sweep_and_are_those_of_the_case_alone(tmp_path):
    few = swept(tmp_path / "out")
    assert len({case for _, case, _ in recorded(few)}) == 1
    held = (few.path / "results.parquet").read_bytes()
    every = swept(tmp_path / "out", None, add=True, traces="all")
    assert (every.path / "results.parquet").read_bytes() == held
    assert recorded(every) == set(every.rows[NAMES].itertuples(index=False, name=None))
    case = every.traces["case"].iloc[-1]
    alone = mc.run("designed-2", case, "interactive", settings=SMALL, world="closed-form").trace
    own = every.traces[(every.traces["case"] == case) & (every.traces["method"] == "interactive")]
    pd.testing.assert_frame_equal(own[alone.columns].reset_index(drop=True), alone)


def test_the_cheapest_candidate_of_ipcb_is_driven_and_its_costs_are_in_the_page(tmp_path):
    results = swept(tmp_path / "out", ["ipcb"], traces=1)
    traces = results.traces
    names = [name for name in traces if name.startswith("cost ")]
    assert names[0] == "cost -4 m/s²"
    assert names[-1] == "cost +2 m/s²"
    plans = traces["merging_station_m"] < 0
    assert traces.loc[~plans, names].isna().all(axis=None)
    chosen = traces.loc[plans, "policy"].to_numpy(dtype=int)
    np.testing.assert_array_equal(chosen, traces.loc[plans, names].to_numpy().argmin(axis=1))
    np.testing.assert_allclose(-4 + 0.5 * chosen, traces.loc[plans, "host_acceleration_m_s2"], atol=1e-6)
    data = json.loads(results.report().read_text(encoding="utf-8").partition('id="data">')[2].partition("</script>")[0])
    (run,) = data["cases"][0]["runs"]
    assert run["unit"] == ""
    assert run["policies"] == [name.removeprefix("cost ") for name in names]
    np.testing.assert_array_equal(np.cumsum(run["policy"]), chosen)


def test_the_cost_of_each_policy_is_recorded_until_the_merging_car_is_in_the_lane(tmp_path):
    results = swept(tmp_path / "out", ["interactive"], traces=1)
    costs = results.traces[[f"cost_s {name}" for name in POLICIES]]
    plans = results.traces["merging_station_m"] < 0
    assert costs[plans].notna().all(axis=None)
    assert costs[~plans].isna().all(axis=None)
    chosen = results.traces.loc[plans, "policy"].to_numpy(dtype=int)
    least = costs[plans].min(axis=1).to_numpy()
    driven = costs[plans].to_numpy()[np.arange(len(chosen)), chosen]
    assert (driven <= least + 0.2 + 1e-9).all()  # the commitment
    page = results.report().read_text(encoding="utf-8")
    data = json.loads(page.partition('id="data">')[2].partition("</script>")[0])
    (run,) = data["cases"][0]["runs"]
    assert run["policies"] == list(POLICIES)
    np.testing.assert_array_equal(np.cumsum(run["policy"]), chosen)


def test_a_page_takes_as_many_cases_as_it_has_room_for_from_every_scenario():
    frame = pd.DataFrame(
        [("a", f"{number}", method) for number in range(30) for method in "mn"] + [("b", "0", "m"), ("b", "1", "m")],
        columns=NAMES,
    ).assign(cycles=MOST_CYCLES // 10)
    shown, left_out = fitting(frame)
    assert shown == [("a", "0"), ("a", "1"), ("a", "2"), ("a", "3"), ("b", "0"), ("b", "1")]
    assert left_out == 32 - 6


def test_nothing_is_recorded_where_nothing_is_wanted(tmp_path):
    assert swept(tmp_path / "out", ["acc", "always-go"], traces=0).traces.empty


@pytest.mark.parametrize("wrong", ["some", "-1", "1.5"])
def test_another_wish_is_one_line(tmp_path, wrong):
    with pytest.raises(mc.UserError, match=r"give all, failed, telling, or a number of cases"):
        swept(tmp_path / "out", traces=wrong)

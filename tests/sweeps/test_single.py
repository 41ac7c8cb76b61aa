"""One case alone and a few cases one at a time, without the command line."""

import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.single import case_alone, trace_case, trace_methods
from merge_cosim.sweeps.single_timing import SINGLE_CASES, time_single_cases

CASE = "d+1_h15_m14"


def request(*methods):
    return SweepRequest(["designed-2"], methods)


def test_a_case_is_found_by_its_name():
    task = case_alone(plan(request("acc")), CASE)
    assert task.cases.encounters.case.tolist() == [CASE]
    with pytest.raises(UserError, match="scenario designed-2: no case 'nosuch'"):
        case_alone(plan(request("acc")), "nosuch")


def test_a_trace_goes_up_to_the_last_command():
    row, _ = trace_case(case_alone(plan(request("acc")), CASE), CASE)
    traces, failed = trace_methods(request("acc", "always-go"), CASE)
    assert set(traces["method"]) == {"acc", "always-go"} == set(failed)
    assert failed["acc"] == row["failed"]
    assert traces.loc[traces["method"] == "acc", "time_s"].max() == pytest.approx(row["end_s"] - 0.1)


def test_a_few_cases_are_timed():
    settings = {"encounters.count": 8}
    times = time_single_cases(plan(SweepRequest(["designed-random"], ["acc", "always-go"], settings=settings)))
    assert set(times) == {"acc", "always-go"}
    assert all(time > 0 for time in times.values())
    assert SINGLE_CASES < 8

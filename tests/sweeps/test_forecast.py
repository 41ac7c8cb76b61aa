"""What is printed before a long sweep."""

import re

import pytest

from merge_cosim.api import progress
from merge_cosim.sweeps.forecast import duration, forecast, seconds
from merge_cosim.sweeps.plan import SweepRequest, plan


def test_a_sweep_of_all_methods_in_three_traffic_scenarios_is_announced():
    tasks = plan(SweepRequest(["traffic-light", "traffic-dense", "traffic-stop-and-go"]))
    text = forecast(tasks, jobs=2)
    scenes, methods = (int(n) for n in re.match(r"(\d+) scenes to run: 3 scenarios, (\d+) methods", text).groups())
    assert scenes == 3 * 8 * methods
    assert text.endswith("with 2 processes")
    assert 10 * 60 < seconds(tasks, jobs=2) < 2 * 3600


def test_a_short_sweep_has_its_cases_printed_and_no_time():
    tasks = plan(SweepRequest(["designed-2"], ["acc"]))
    assert forecast(tasks, jobs=1) == "6,875 cases to run: 1 scenario, 1 method"
    assert seconds(tasks, jobs=1) < 30


def test_a_planner_that_costs_more_is_counted_so():
    slow, usual = (
        seconds(plan(SweepRequest(["designed-2"], [name], world="closed-form")), 1) for name in ("interactive", "acc")
    )
    assert slow > 5 * usual


@pytest.mark.parametrize(("time", "words"), [(20, "20 s"), (150, "2 min"), (7200, "2.0 h")])
def test_times_in_words(time, words):
    assert duration(time) == words


def test_where_there_is_no_terminal_lines_are_printed(capsys, monkeypatch):
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.0)
    with progress.sweep_progress() as show:
        show(0, 4, "4 cases to run")
        show(2, 4, "designed-2 acc")
    first, second = capsys.readouterr().err.splitlines()
    assert first == "4 cases to run"
    assert re.fullmatch(r"2 of 4, about 0 s left: designed-2 acc", second)

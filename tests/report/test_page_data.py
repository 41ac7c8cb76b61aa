"""The numbers and chapters of the page, the short table of the terminal, and the story of a case."""

import math

import numpy as np
import pytest

from merge_cosim.report.chapters import Chapter
from merge_cosim.report.page_data import number
from merge_cosim.report.run_command import run_command
from merge_cosim.report.short_table import short_tables
from merge_cosim.report.story import FAILURES, story
from merge_cosim.results.statistics.verdict import Verdict


def test_numbers_are_rounded_and_what_is_not_finite_is_missing():
    assert number(1.23456789) == 1.2346
    assert number(np.float64(2.5), decimals=0) == 2
    assert number(math.nan) is None


@pytest.mark.parametrize(("low", "expected"), [(None, False), (0.5, True)])
def test_a_chapter_has_intervals_where_a_row_has_one(low, expected):
    said = Verdict(sentence="acc fails least.", order=("acc",), best=("acc",), undecided=())
    rows = [{"failed_low": low, "models": 1, "stuck": 0}]
    found = Chapter("t1", None, "title", "source", "about", said, rows, [], {}, {})
    assert found.has_interval is expected
    assert not found.has_models
    assert not found.has_stuck


def test_short_tables_are_end_with_the_references(swept):
    table, *_ = short_tables(swept)
    assert " of 27 cases" in table.verdict
    assert all("always-go" in row for row in table.cells[table.methods :])  # references come last
    assert not any("always-go" in row for row in table.cells[: table.methods])


def test_a_story_has_five_lines_and_names_the_failure():
    row = {
        "scenario": "designed-2", "case": "a", "source": "designed", "method": "acc", "model": "", "world": "sumo",
        "host_station_0_m": -89.0, "host_speed_0": 15.0, "merging_station_0_m": -90.0, "merging_speed_0": 14.0,
        "host_reached_s": 4.8, "merging_reached_s": math.nan, "distance_m": 1.3, "failed": True, "failure_kind": "side",
        "stuck": False, "censored": False, "min_gap_m": -3.3, "end_s": 4.9, "delay_s": 0.71, "hardest_braking": 4.0,
    }  # fmt: skip
    lines = story(row)
    assert len(lines) == 5
    assert "host after 4.8 s; D 1.3 m" in lines[2]
    assert FAILURES["side"] in lines[3]


def test_the_command_of_a_row_has_the_settings_of_its_method_alone():
    manifest = {
        "command": {"scenarios": ["my/first.toml"], "data": None}, "settings": {"acc.headway": 2, "pgm.nodes": 9},
        "parameters": {"acc": {"acc.headway": 2}, "pgm": {"pgm.nodes": 9}}, "seed": 3, "world": "closed-form",
        "source": None, "plugins": [],
    }  # fmt: skip
    row = {"scenario": "first", "case": "a b", "method": "acc", "variation": "", "model": "", "source": "designed"}
    assert run_command(row, manifest) == (
        "merge-cosim run my/first.toml --case 'a b' --method acc --set acc.headway=2 --seed 3 --world closed-form"
    )

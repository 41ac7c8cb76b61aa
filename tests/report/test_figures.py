"""The figures, drawn from a real sweep and from small tables."""

import base64

import numpy as np
import pandas as pd
import pytest

from merge_cosim.report.case_figures import log_odds_figure, path_figures
from merge_cosim.report.html import data_uri
from merge_cosim.report.methods import looks
from merge_cosim.report.set_figures import ambiguity_figure, failure_map, variation_figure
from merge_cosim.report.tables import summary_frame
from merge_cosim.results.store import SUMMARY_JSON, ResultFolder


def _trace(method: str, host_speed: float, odds: float, seconds: float = 4.0) -> pd.DataFrame:
    time = np.arange(0.0, seconds, 0.1)
    host = {"host_station_m": -20.0 + host_speed * time, "host_speed_m_s": np.full_like(time, host_speed)}
    merging = {"merging_station_m": -30.0 + 10.0 * time, "merging_speed_m_s": np.full_like(time, 10.0)}
    return pd.DataFrame({"time_s": time, "method": method, "log_odds": odds} | host | merging)


@pytest.fixture(scope="module")
def results(swept):
    rows = ResultFolder(swept).results().to_pandas()
    return rows[rows["variation"] == ""]


def _labels(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_methods_that_drove_alike_share_a_line():
    traces = pd.concat([_trace("slot", 10.0, 1.0), _trace("acc", 10.0, 1.0), _trace("pgm", 5.0, 1.0, 5.0)])
    stations, speeds = path_figures(traces, {"acc": False, "slot": False, "pgm": True}, looks(traces["method"]))
    assert _labels(stations) == ["acc, slot", "pgm ×", "merging car"]
    assert _labels(speeds) == _labels(stations)


def test_merging_cars_that_differ_are_drawn_one_by_one():
    other = _trace("pgm", 5.0, 1.0)
    other["merging_station_m"] -= np.arange(len(other)) * 0.1
    traces = pd.concat([_trace("acc", 10.0, 1.0), other])
    alike, _ = path_figures(_trace("acc", 10.0, 1.0), {"acc": False}, looks(["acc"]))
    apart, _ = path_figures(traces, {"acc": False, "pgm": False}, looks(["acc", "pgm"]))
    dashed = [sum(line.get_linestyle() == "--" for line in figure.axes[0].lines) for figure in (alike, apart)]
    assert dashed == [3, 4]  # the merging point, the legend's sample, and one line per merging car


def test_log_odds_only_of_estimators_that_weigh():
    traces = pd.concat([_trace("acc", 10.0, np.inf), _trace("pgm", 5.0, 50.0)])
    figure = log_odds_figure(traces, looks(traces["method"]))
    assert _labels(figure) == ["pgm"]
    assert figure.axes[0].lines[0].get_ydata().max() == 12.0
    assert figure.axes[0].lines[0].get_xdata().max() < 3.0  # the merging car arrives at 3 s
    assert log_odds_figure(_trace("acc", 10.0, -np.inf), looks(["acc"])) is None


def test_failure_map_shows_the_share_of_failed_offsets(results):
    figure = failure_map(results)
    panel = next(ax for ax in figure.axes if ax.get_title() == "always-go")
    shown = panel.collections[0].get_array()
    go = results[(results["method"] == "always-go")]
    assert shown.shape == (3, 3)
    assert shown.mean() == pytest.approx(100 * go["failed"].mean())
    same = go[(go["host_speed_0"] == 15.0) & (go["merging_speed_0"] == 15.0)]
    assert shown[1, 1] == pytest.approx(100 * same["failed"].mean())


@pytest.mark.parametrize(("cases", "width"), [(2_000, 1), (500, 2), (100, 5)])
def test_failure_map_of_random_cases_has_classes_of_speeds(cases, width):
    states = np.random.default_rng(0).uniform(5.0, 25.0, (2, cases))
    host, merging = states
    rows = pd.DataFrame({"method": "m", "host_speed_0": host, "merging_speed_0": merging, "host_reached": True})
    panel = failure_map(rows.assign(failed=host > 15.0)).axes[0].collections[0]
    shown, _, counts = panel.get_array(), *np.unique(states // width, axis=1, return_counts=True)
    middle = np.unique((host // width + 0.5) * width)
    assert shown.shape == (len(middle), len(middle))
    assert np.ma.filled(shown[middle < 14.0], 0.0).max() == 0.0
    assert shown[middle > 16.0].min() == 100.0
    assert shown.count() == len(counts)  # where there is no case there is no share, either


def test_other_figures_can_be_drawn(swept, results):
    drawn = looks(results["method"])
    labels = ["merging.ahead=clear", "merging.ahead=any", "test.horizon=1", "test.horizon=3"]
    summary = summary_frame(ResultFolder(swept).read_json(SUMMARY_JSON), labels)
    bars = variation_figure(summary, "merging.ahead", drawn)
    assert [tick.get_text() for tick in bars.axes[0].get_xticklabels()] == ["clear", "any"]
    lines = variation_figure(summary, "test.horizon", drawn)
    assert lines.axes[0].lines[0].get_xdata().tolist() == [1.0, 3.0]
    assert len(ambiguity_figure(results, drawn).axes) == 4


def test_a_picture_is_its_own_bytes():
    uris = [data_uri(path_figures(_trace("acc", 10.0, 1.0), {"acc": True}, looks(["acc"]))[0]) for _ in range(2)]
    assert uris[0] == uris[1]
    assert base64.b64decode(uris[0].partition(",")[2]).lstrip().startswith(b"<?xml")

"""Figures of beliefs: they show what the estimators say."""

import numpy as np
import pytest

from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.report.belief_cases import behind_but_accelerating, pulls_ahead, stays_behind
from merge_cosim.report.belief_figures import belief_figure, candidates_figure, clouds_figure

MODEL = IntentionModel.load("us101-ngsim")


@pytest.mark.parametrize("driver", [stays_behind, pulls_ahead])
def test_the_two_drivers_move_as_the_plant_moves_cars(driver):
    scenes = driver()
    assert len(scenes) == 121
    station, speed = (np.array([getattr(s, f"merging_{q}")[0] for s in scenes]) for q in ("station", "speed"))
    np.testing.assert_allclose(np.diff(station), 0.1 * speed[1:])
    host = np.array([s.host_station[0] for s in scenes])
    assert station[0] < host[0] < host[-1] < 0
    assert (station[-1] > host[-1]) == (driver is pulls_ahead)


def test_behind_but_accelerating_ends_where_it_should():
    scenes = behind_but_accelerating((-60.0, 18.0), (-65.0, 18.0), 1.0, 30)
    assert len(scenes) == 30
    last = scenes[-1]
    assert (last.host_station[0], last.merging_station[0], last.merging_speed[0]) == (-60.0, -65.0, 18.0)
    station, speed = (np.array([getattr(s, f"merging_{q}")[0] for s in scenes]) for q in ("station", "speed"))
    np.testing.assert_allclose(np.diff(station), 0.1 * speed[1:])
    np.testing.assert_allclose(np.diff(speed), 0.1)


def test_clouds_show_every_particle_in_each_stage():
    figure = clouds_figure(MODEL)
    assert len(figure.axes) == 3
    for axes in figure.axes:
        assert sum(len(line.get_xdata()) for line in axes.lines[:3]) == 200
        assert len(axes.lines[3].get_xdata()) == 1
    # the update draws the cloud to what is observed
    seen = figure.axes[2].lines[3].get_ydata()[0]
    off = [
        abs(np.mean(np.concatenate([line.get_ydata() for line in axes.lines[:3]])) - seen) for axes in figure.axes[1:]
    ]
    assert off[1] < off[0]


def test_beliefs_sum_to_one_and_part_after_the_second_driver_pulls():
    figure = belief_figure(MODEL)
    lines = [[np.asarray(line.get_ydata(), dtype=float) for line in axes.lines] for axes in figure.axes]
    for yields, not_yield, ignores, _ in lines:
        np.testing.assert_allclose(yields + not_yield + ignores, 1.0)
    np.testing.assert_array_equal(lines[0][3][:55], lines[1][3][:55])
    assert lines[0][3][-1] < 0.1
    assert lines[1][3][-1] > 0.9


def test_candidates_show_both_costs_and_both_commands():
    axes = candidates_figure(MODEL).axes[0]
    if_yield, if_not, expected, driven, pgm = axes.lines
    low = np.minimum(if_yield.get_ydata(), if_not.get_ydata())
    high = np.maximum(if_yield.get_ydata(), if_not.get_ydata())
    assert ((low <= expected.get_ydata()) & (expected.get_ydata() <= high)).all()
    assert driven.get_ydata()[0] == min(expected.get_ydata())
    # Fig. 3 of Dong, Dolan, Litkouhi 2017: iPCB slows down, PGM goes on
    assert driven.get_xdata()[0] < 0 < pgm.get_xdata()[0]

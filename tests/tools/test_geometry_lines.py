"""Plane geometry behind the drawn ramps, against closed forms."""

import numpy as np
import pytest
from geometry.frame import Frame, Tie
from geometry.lines import SURVEY_FOOT, Line, read_lines
from geometry.ramp_lanes import Correction, joined
from geometry.survey import lane_centres, middle, strip_widths
from hypothesis import given
from hypothesis import strategies as st

RADIUS = 400.0
ANGLES = np.linspace(0.0, 1.0, 401)
BEND = Line(RADIUS * np.column_stack([np.sin(ANGLES), np.cos(ANGLES)]))
"""A right-hand bend of 400 m about the origin, driven clockwise from (0, 400)."""


def test_arc_length_and_sides() -> None:
    assert BEND.length == pytest.approx(RADIUS, rel=1e-6)
    inside = BEND.place(np.array([200.0]), 10.0)
    assert np.hypot(*inside[0]) == pytest.approx(RADIUS - 10.0, abs=1e-3)
    inner = Line(BEND.place(np.linspace(50.0, 350.0, 301), 10.0))
    assert inner.length == pytest.approx(300.0 * (1.0 - 10.0 / RADIUS), rel=1e-4)


@given(station=st.floats(2.0, 398.0), right=st.floats(-30.0, 30.0))
def test_locate_is_the_inverse_of_place(station: float, right: float) -> None:
    along, across = BEND.locate(BEND.place(np.array([station]), right))
    assert along[0] == pytest.approx(station, abs=0.05)
    assert across[0] == pytest.approx(right, abs=0.01)


@given(tolerance=st.floats(0.005, 1.0))
def test_no_dropped_corner_is_further_off_than_the_tolerance(tolerance: float) -> None:
    simple = BEND.simple(tolerance)
    assert len(simple.points) < len(BEND.points)
    assert np.abs(simple.locate(BEND.points)[1]).max() <= tolerance + 1e-9


def test_a_line_goes_straight_on_beyond_its_ends() -> None:
    straight = Line(np.array([[0.0, 0.0], [100.0, 0.0]]))
    np.testing.assert_allclose(straight.part(-50.0, 150.0).points, [[-50, 0], [0, 0], [100, 0], [150, 0]])
    np.testing.assert_allclose(straight.locate(np.array([[130.0, -4.0]])), [[130.0], [4.0]])


def test_smoothing_keeps_ends_and_course() -> None:
    smooth = BEND.smooth(30.0)
    assert np.abs(BEND.locate(smooth.points)[1]).max() < 0.15
    straight = Line(np.array([[0.0, 0.0], [100.0, 0.0]]))
    np.testing.assert_allclose(straight.smooth(30.0).points[[0, -1]], straight.points, atol=1e-9)


def test_the_middle_of_lanes_of_unequal_widths() -> None:
    widths = np.array([4.0, 3.0, 3.5])
    edges = [BEND.beside(right) for right in (-5.25, -1.25, 1.75, 5.25)]
    np.testing.assert_allclose(strip_widths(BEND, edges), widths, atol=0.01)
    centres = [BEND.beside(right) for right in lane_centres(widths)]
    axis = middle(BEND, centres, widths)
    assert np.abs(BEND.locate(axis.points[20:-20])[1]).max() < 0.15  # what averaging over 30 m cuts off a bend


def test_a_frame_brings_the_published_row_to_its_place() -> None:
    place = BEND.place(np.array([120.0]), 2.0)[0] / SURVEY_FOOT
    frame = Frame.tied(BEND, (Tie((30.0, 200.0), (float(place[0]), float(place[1]))),), 80.0)
    np.testing.assert_allclose(frame.plane(30.0, 200.0)[0] / SURVEY_FOOT, place, atol=0.1)
    x, _ = frame.road(np.array([30.0]), np.array([200.0]))
    assert x[0] == pytest.approx(200.0 * 0.3048 - 80.0)


def test_a_correction_is_zero_at_the_node_and_fades_out() -> None:
    on = Correction(node=0.0, sign=-1, seen=30.0, linear=0.01, square=0.001, cars=1)
    np.testing.assert_allclose(on.at(np.array([5.0, 0.0, -30.0, -50.0, -70.0])), [0.0, 0.0, 1.2, 0.6, 0.0])


def test_joined_lines_are_one_line() -> None:
    first = Line(np.array([[0.0, 0.0], [50.0, 0.0]]))
    second = Line(np.array([[50.0, 0.0], [50.0, -50.0]]))
    both = joined(first, second)
    assert 85.0 < both.length < 100.0
    np.testing.assert_allclose(both.points[[0, -1]], [[0.0, 0.0], [50.0, -50.0]], atol=1e-6)


def test_a_survey_file_is_read_in_metres(tmp_path) -> None:
    text = "CENTERLINES\n1\nCENTERLINE\nlane\n2\n 0.0   0.0\n 3937.0   0.0\nBOUNDARY 3\n2\n0 0\n0 3937\n"
    (tmp_path / "lines.txt").write_text(text)
    lines = read_lines(tmp_path / "lines.txt")
    assert {name: line.length for name, line in lines.items()} == {"lane": 1200.0, "boundary3": 1200.0}

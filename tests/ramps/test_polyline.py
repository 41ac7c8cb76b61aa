"""Lines in the plane, by hand."""

import numpy as np
import pytest

from merge_cosim.ramps import polyline

CORNER = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]])


def test_length_and_directions():
    assert polyline.length(CORNER) == 15.0
    half = np.sqrt(0.5)
    np.testing.assert_allclose(polyline.directions(CORNER), [[1.0, 0.0], [half, half], [0.0, 1.0]])
    np.testing.assert_allclose(polyline.left_of(np.array([[1.0, 0.0], [0.0, 1.0]])), [[0.0, 1.0], [-1.0, 0.0]])


def test_a_line_beside_keeps_its_distance_round_a_corner():
    np.testing.assert_allclose(polyline.beside(CORNER, 1.0), [[0.0, 1.0], [9.0, 1.0], [9.0, 5.0]], atol=1e-9)
    np.testing.assert_allclose(polyline.beside(CORNER, -1.0), [[0.0, -1.0], [11.0, -1.0], [11.0, 5.0]], atol=1e-9)


def test_points_too_near_to_another_are_left_out():
    points = [(0.0, 0.0), (0.2, 0.0), (5.0, 0.0), (9.8, 0.0), (10.0, 0.0)]
    assert polyline.through(points).tolist() == [[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]]


@pytest.mark.parametrize("wanted", [4.0, 12.0, 40.0])
@pytest.mark.parametrize("at_start", [True, False])
def test_a_line_gets_the_wanted_length_at_one_end(wanted, at_start):
    line = polyline.with_length(CORNER, wanted, at_start)
    assert polyline.length(line) == pytest.approx(wanted)
    kept = -1 if at_start else 0
    assert line[kept].tolist() == CORNER[kept].tolist()


def test_the_nearest_point_of_a_segment():
    start, end = CORNER[:2]
    for point, nearest in (((3.0, 4.0), (3.0, 0.0)), ((-3.0, 4.0), (0.0, 0.0)), ((13.0, 4.0), (10.0, 0.0))):
        assert polyline.nearest_on(start, end, np.array(point)).tolist() == list(nearest)

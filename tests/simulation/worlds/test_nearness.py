import numpy as np
import pytest

from merge_cosim.simulation.worlds.nearness import Places, in_conflict, near


def places(*cars: tuple[int, float, float]) -> Places:
    """Cars of 4 m by lane, x and speed."""
    lane, x, speed = np.array(cars).T
    return Places(lane.astype(np.int64), x, np.full(len(cars), 4.0), speed)


@pytest.mark.parametrize(
    ("behind", "ahead", "conflict"),
    [
        ((5, 0.0, 10.0), (5, 7.01, 10.0), False),  # a gap of 3 m is needed: 2 m and one cycle's way
        ((5, 0.0, 10.0), (5, 6.99, 10.0), True),
        ((5, 0.0, 10.0), (5, 6.99, 9.0), True),
        ((5, 0.0, 15.0), (5, 45.1, 0.0), False),  # 2 + 1.5 + 15^2 / 6 = 41 m
        ((5, 0.0, 15.0), (5, 44.9, 0.0), True),
        ((4, 0.0, 10.0), (5, 1.0, 10.0), False),  # another lane
        ((5, 0.0, 10.0), (5, -3.9, 10.0), True),  # it overlaps with the one behind it
        ((5, 0.0, 10.0), (5, -4.0, 10.0), False),  # they touch
        ((5, 0.0, 10.0), (5, 0.0, 10.0), True),
    ],
)
def test_conflicts(behind: tuple[int, float, float], ahead: tuple[int, float, float], conflict: bool) -> None:
    assert in_conflict(places(behind), places(ahead), min_gap=2.0, decel=3.0).tolist() == [[conflict]]


def test_each_car_is_compared_with_each_other() -> None:
    cars = places((5, 0.0, 10.0), (4, 0.0, 10.0))
    others = places((4, 3.0, 10.0), (5, 50.0, 10.0), (5, -2.0, 10.0))
    assert in_conflict(cars, others, 2.0, 3.0).tolist() == [[False, False, True], [True, False, False]]


def test_near_is_beside_or_in_the_same_lane() -> None:
    cars = places((5, 30.0, 9.0), (5, 30.1, 9.0), (4, -60.0, 9.0), (6, -60.1, 9.0), (3, 0.0, 9.0))
    assert near(cars, lane=5, x=0.0, ahead=30.0, behind=60.0).tolist() == [True, False, True, False, False]

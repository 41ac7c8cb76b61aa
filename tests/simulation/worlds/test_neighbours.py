"""Leader and follower of a host, among cars that may drive through it."""

import math

import pytest

from merge_cosim.simulation.worlds.neighbours import InLane, Neighbours


def look(neighbours: Neighbours, *cars: tuple[str, float]) -> tuple[str, float, float]:
    """Show cars of 4 m around a host of 5 m at x = 100 m."""
    neighbours.look(100.0, [InLane(name, x, 4.0) for name, x in cars])
    return neighbours.leader, neighbours.leader_gap, neighbours.follower_gap


def test_the_nearest_cars_ahead_and_behind_are_found() -> None:
    seen = Neighbours(5.0, sight=50.0)
    assert look(seen, ("far", 140), ("near", 110), ("behind", 90), ("last", 60)) == ("near", 6.0, 5.0)
    assert look(seen, ("behind", 90)) == ("", math.inf, 5.0)
    assert look(seen, ("near", 110)) == ("near", 6.0, math.inf)
    assert look(seen, ("out of sight", 155), ("so is this", 44)) == ("", math.inf, math.inf)
    assert look(seen, ("touches", 104), ("touches, too", 95)) == ("touches", 0.0, 0.0)
    assert seen.through == []


def test_a_car_that_drives_through_the_host_is_reported_once_and_then_ignored() -> None:
    seen = Neighbours(5.0, sight=50.0)
    assert look(seen, ("leader", 120), ("follower", 94.5))[2] == 0.5
    assert look(seen, ("leader", 120), ("follower", 95.5)) == ("leader", 16.0, -0.5)
    assert seen.through == ["follower"]
    for x in (99.0, 100.0, 103.0, 105.0, 110.0, 90.0):
        assert look(seen, ("leader", 120), ("follower", x)) == ("leader", 16.0, math.inf)
    assert seen.through == ["follower"]


@pytest.mark.parametrize("x", [97.0, 103.0])
def test_a_car_that_changes_onto_the_host_has_driven_into_it(x: float) -> None:
    seen = Neighbours(5.0, sight=50.0)
    look(seen)
    leader, leader_gap, follower_gap = look(seen, ("from the side", x))
    assert (leader, leader_gap) == ("", math.inf)
    assert follower_gap == (-2.0 if x < 100 else math.inf)
    assert seen.through == ["from the side"]


def test_a_leader_stays_the_leader_when_the_host_drives_into_it() -> None:
    seen = Neighbours(5.0, sight=50.0)
    look(seen, ("leader", 104.5))
    assert look(seen, ("leader", 103.0)) == ("leader", -1.0, math.inf)
    assert look(seen, ("leader", 100.0)) == ("leader", -4.0, math.inf)
    for x in (99.0, 96.0, 90.0):  # the host is through it
        assert look(seen, ("leader", x)) == ("", math.inf, math.inf)
    assert (seen.through, seen.struck) == ([], {"leader"})

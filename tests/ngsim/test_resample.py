"""Recordings of other frame rates become 10 Hz."""

import numpy as np
from trajectory_tables import steady, table

from merge_cosim.ngsim.resample import at_10_hz, without_first


def test_five_frames_per_second() -> None:
    """Cars of 15 m/s at 5 Hz: 3 m per frame; the clock's frame 10 (2 s) becomes 20."""
    slow = table(steady(1, [6, 6, 5, 5], at=0, speed=30, frame=10), steady(2, [5, 5], at=90, speed=30, part=2))
    fast = at_10_hz(slow, 5.0)
    assert fast.schema == slow.schema
    assert fast["vehicle_id"].to_pylist() == [1] * 7 + [2] * 3
    assert fast["part"].to_pylist() == [1] * 7 + [2] * 3
    assert fast["frame"].to_pylist() == [*range(20, 27), *range(3)]
    assert fast["lane"].to_pylist() == [6, 6, 6, 6, 5, 5, 5, 5, 5, 5]
    first = slow["y"].to_numpy()
    np.testing.assert_allclose(fast["y"].to_numpy()[:7], first[0] + 1.5 * np.arange(7), atol=1e-9)
    np.testing.assert_allclose(fast["y"].to_numpy()[7:], first[4] + 1.5 * np.arange(3), atol=1e-9)


def test_frames_between_those_of_the_new_clock() -> None:
    """At 25 Hz the frames 3 to 9 are 0.12 to 0.36 s: of the new clock's instants 0.2 and 0.3 s lie between."""
    made = at_10_hz(table(steady(1, [5] * 4 + [4] * 3, at=0, speed=4, frame=3)), 25.0)
    assert made["frame"].to_pylist() == [2, 3]
    assert made["lane"].to_pylist() == [5, 4]
    np.testing.assert_allclose(np.diff(made["y"].to_numpy()), 1.0, atol=1e-9)


def test_a_part_between_two_instants_is_left_out() -> None:
    assert at_10_hz(table(steady(1, [5, 5], at=0, frame=1)), 100.0).num_rows == 0
    assert at_10_hz(table(steady(1, [5, 5], at=0))[:0], 5.0).num_rows == 0


def test_a_part_of_one_frame_stays_where_the_new_clock_has_its_instant() -> None:
    cars = table(steady(1, [5], at=7, frame=4), steady(2, [5], at=8, frame=4), steady(3, [5, 5, 5], at=9, frame=5))
    made = at_10_hz(cars, 20.0)
    assert made["vehicle_id"].to_pylist() == [1, 2, 3]
    assert made["frame"].to_pylist() == [2, 2, 3]
    assert made["y"].to_pylist() == [*cars["y"].to_pylist()[:2], cars["y"].to_pylist()[3]]
    assert at_10_hz(cars[:1], 40.0)["frame"].to_pylist() == [1]
    assert at_10_hz(cars[:1], 30.0).num_rows == 0


def test_ten_frames_per_second_stay() -> None:
    cars = table(steady(1, [5] * 4, at=0))
    assert at_10_hz(cars, 10.0) is cars


def test_first_frames_of_each_part_are_left_out() -> None:
    cars = table(steady(1, [5] * 3, at=0), steady(1, [5] * 2, at=9, frame=7, part=2), steady(2, [5], at=0))
    assert without_first(cars, 1)["frame"].to_pylist() == [1, 2, 8]
    assert without_first(cars, 2)["frame"].to_pylist() == [2]
    assert without_first(cars, 0) is cars

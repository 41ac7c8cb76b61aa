from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trajectory_tables import GORE, steady, table

from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.tracks import build_tracks, carried_on, steady_lanes, without_flicker
from merge_cosim.ngsim.sites import Lanes, site

US101 = site("us101")


def flicker(lanes: str, hold: int = 5) -> str:
    """`#` is in the lane, `.` is not, a blank starts a track."""
    tracks = lanes.split()
    offsets = np.concatenate([[0], np.cumsum([len(track) for track in tracks])])
    flat = np.array([lane == "#" for lane in "".join(tracks)])
    kept = without_flicker(flat, offsets, hold)
    return " ".join("".join(".#"[int(x)] for x in kept[a:b]) for a, b in pairwise(offsets))


@pytest.mark.parametrize(
    ("logged", "kept"),
    [
        ("......#####", "......#####"),  # exactly 0.5 s holds
        ("......####.....", "..............."),  # 0.4 s does not
        ("......####", ".........."),  # nor is it known to hold at the end of a log
        (".....###.#####", ".........#####"),  # the first change that holds
        ("#####....#####", "##############"),  # a departure that comes back
        ("#####.....#####", "#####.....#####"),
        ("#####...", "#####..."),  # a departure at the end does not come back
        ("##.....", "##....."),  # a track begins where it begins
        ("##### ....", "##### ...."),  # nothing passes from track to track
        ("..... ##..... #####..", "..... ##..... #####.."),
    ],
)
def test_flicker(logged: str, kept: str) -> None:
    assert flicker(logged) == kept


def test_only_cars_near_the_merge_are_kept_and_tracks_end_at_gaps() -> None:
    cars = table(
        steady(1, [3] * 30, at=0),
        steady(2, [5] * 10, at=0, length=4.5),
        steady(2, [5] * 8, at=0, frame=15, part=2),
        steady(3, [7] * 10 + [6] * 10 + [5] * 10, at=-20),
    )
    tracks = build_tracks(cars, US101, PairRules())
    np.testing.assert_array_equal(tracks.vehicle, [2, 2, 3])
    np.testing.assert_array_equal(tracks.part, [1, 2, 1])
    np.testing.assert_array_equal(tracks.first_frame, [0, 15, 0])
    np.testing.assert_array_equal(tracks.last_frame, [9, 22, 29])
    np.testing.assert_allclose(tracks.length, [4.5, 4, 4])
    car, row = tracks.merges()
    assert (car.tolist(), (row - tracks.offsets[car]).tolist()) == ([2], [20])
    assert tracks.y[row[0]] == pytest.approx(GORE - 20 + 20 * 1.5)


@pytest.mark.parametrize(
    "lanes",
    [
        [5] * 20 + [6] * 20 + [5] * 20,  # from the main road and back
        [6] * 30 + [8] * 20,  # to the off-ramp
        [6] * 30 + [5] * 4 + [6] * 20,  # flicker
        [4] * 30 + [5] * 20,
    ],
)
def test_what_is_no_merge(lanes: list[int]) -> None:
    car, _ = build_tracks(table(steady(1, lanes, at=0)), US101, PairRules()).merges()
    assert len(car) == 0


def test_leaving_the_host_lane() -> None:
    cars = table(steady(1, [5] * 10 + [4] * 10, at=0), steady(2, [5] * 10, at=0))
    tracks = build_tracks(cars, US101, PairRules())
    np.testing.assert_array_equal(tracks.leaves(np.array([0, 0, 1]), np.array([0, 12, 20])), [10, 12, 30])


@pytest.mark.parametrize(
    ("logged", "kept"),
    [
        ("2222211111", "2222211111"),
        ("3333344333", "3333333333"),  # there and back
        ("333334422222", "333333322222"),  # on the way to another lane
        ("66666566655555", "66666666655555"),  # the first change that holds, as for the pairs
        ("55555666", "55555555"),  # not known to hold
        ("1 22222 2", "1 22222 2"),  # a track begins where it begins
    ],
)
def test_flicker_between_any_lanes(logged: str, kept: str) -> None:
    tracks = logged.split()
    offsets = np.concatenate([[0], np.cumsum([len(track) for track in tracks])])
    lanes = steady_lanes(np.array([int(lane) for lane in "".join(tracks)]), offsets, 5)
    assert " ".join("".join(map(str, lanes[a:b])) for a, b in pairwise(offsets)) == kept


@given(st.lists(st.sampled_from([4, 5, 6]), min_size=1, max_size=12), st.lists(st.integers(1, 9), min_size=12))
def test_a_car_comes_into_the_host_lane_alike_by_both_rules(lanes: list[int], lengths: list[int]) -> None:
    lane = np.repeat([6, *lanes], [1, *lengths[: len(lanes)]])
    offsets = np.array([0, len(lane)])
    among_all = steady_lanes(lane, offsets, 5) == 5
    alone = without_flicker(lane == 5, offsets, 5)
    assert np.argmax(among_all) == np.argmax(alone)


def test_a_shared_lane_is_the_lane_before_it() -> None:
    """Of the lanes 5 and 15 both are the host lane; 9 says nothing, at a track's start it counts as the host lane."""
    lanes = Lanes(host=(5, 15), ramp=(6,), shared=(9,))
    cars = table(steady(1, [6] * 3 + [9] * 6 + [15] * 6, at=0), steady(2, [9] * 3 + [5] * 6 + [9] * 6, at=40))
    tracks = build_tracks(cars, US101.model_copy(update={"lanes": lanes}), PairRules())
    assert tracks.lane.tolist() == [6] * 9 + [5] * 6 + [5] * 15
    assert tracks.on_ramp.tolist() == [True] * 9 + [False] * 21
    assert [array.tolist() for array in tracks.merges()] == [[0], [9]]


def test_tracks_are_carried_on_at_their_last_speed() -> None:
    tracks = build_tracks(table(steady(1, [6] * 10, at=0), steady(2, [5] * 12, at=40, frame=3)), US101, PairRules())
    more = carried_on(tracks, 4)
    assert (more.offsets.tolist(), more.last_frame.tolist(), more.carried) == ([0, 14, 30], [13, 18], 4)
    expected = table(steady(1, [6] * 14, at=0), steady(2, [5] * 16, at=40, frame=3))
    np.testing.assert_allclose(more.y, expected["y"].to_numpy(), atol=1e-9)
    assert more.lane.tolist() == [6] * 14 + [5] * 16
    assert carried_on(tracks, 0) is tracks

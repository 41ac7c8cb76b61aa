import numpy as np
import pyarrow as pa
import pytest
from trajectory_tables import Car, steady, table

from merge_cosim.core.encounter import NEVER, Intention
from merge_cosim.core.units import DT
from merge_cosim.ngsim.pairing.checks import replay_logged_host
from merge_cosim.ngsim.pairing.pairs import Paired, extract_pairs
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.sites import site

US101 = site("us101")

RAMP = [7] * 15 + [6] * 15
MERGE = RAMP + [5] * 60
"""Changes into the host lane in frame 30, at 45 m past the gore if it starts at the gore with 15 m/s."""


def pairs(*cars: Car, **rules: object) -> Paired:
    return extract_pairs(table(*cars), US101, PairRules(**rules), "ngsim")


def test_a_merge_between_two_hosts() -> None:
    paired = pairs(
        steady(42, MERGE, at=0, length=4.5),
        steady(17, [5] * 90, at=-20, speed=16, length=5.5),
        steady(18, [5] * 90, at=25, speed=14),
        steady(19, [5] * 90, at=-40),  # further behind
        steady(20, [4] * 90, at=1),  # another lane
    )
    e = paired.encounters
    assert (paired.merging_cars, paired.rejected) == (1, {})
    assert e.case.tolist() == ["r-42.1-h17.1", "r-42.1-h18.1"]
    assert e.car.tolist() == ["us101/r/42/1"] * 2
    assert e.site.tolist() == ["us101"] * 2
    assert e.source.tolist() == ["ngsim"] * 2
    np.testing.assert_array_equal(e.label, [Intention.NOT_YIELD, Intention.YIELD])
    np.testing.assert_allclose(e.merging_station, -45)
    np.testing.assert_allclose(e.host_station, [-65, -20])
    np.testing.assert_allclose(e.merging_speed, 15)
    np.testing.assert_allclose(e.host_speed, [16, 14])
    np.testing.assert_allclose(e.merge_position, 45)
    np.testing.assert_allclose(e.host_length, [5.5, 4])
    np.testing.assert_allclose(e.merging_length, 4.5)
    assert not e.length_missing.any()
    assert not e.smoothed_source.any()
    assert e.log is not None
    np.testing.assert_array_equal(e.log.change_cycle, 30)
    np.testing.assert_array_equal(e.log.score_until, NEVER)
    assert e.log.merging_station.lengths.tolist() == e.log.host_station.lengths.tolist() == [90, 90]


def test_stations_are_zero_at_the_change_and_replayed_speeds_meet_them() -> None:
    time = np.arange(90) * DT
    rng = np.random.default_rng(0)
    wavy = 14 * time + 2 * np.sin(time) + rng.normal(0, 0.02, 90)
    e = pairs(Car(1, MERGE, wavy), Car(2, [5] * 90, wavy - 12)).encounters
    assert e.log is not None
    track = e.log.merging_station[0]
    assert track[e.log.change_cycle[0]] == 0
    assert track[0] == e.merging_station[0]
    speeds = np.diff(track) / DT
    assert speeds[0] == pytest.approx(e.merging_speed[0])
    assert speeds.min() >= 0
    np.testing.assert_allclose(e.merging_station[0] + np.cumsum(speeds * DT), track[1:], atol=1e-9)


@pytest.mark.parametrize(("distance", "accepted"), [(60.0, True), (60.001, False), (-60.0, True), (-60.001, False)])
def test_hosts_stand_at_most_60_m_away(distance: float, accepted: bool) -> None:
    paired = pairs(steady(1, MERGE, at=0), steady(2, [5] * 90, at=distance))
    assert len(paired.encounters) == accepted
    assert paired.rejected == ({} if accepted else {"no_host": ("us101/r/1/1",)})


def test_side_by_side_is_yielding() -> None:
    e = pairs(steady(1, MERGE, at=0), steady(2, [5] * 90, at=0)).encounters
    assert e.label.tolist() == [Intention.YIELD]
    level = pairs(steady(1, MERGE, at=0), steady(2, [5] * 90, at=0), steady(3, [5] * 90, at=-9)).encounters
    assert level.label.tolist() == [Intention.NOT_YIELD, Intention.YIELD]  # a level car is the one ahead


def test_the_window_starts_when_both_are_logged() -> None:
    e = pairs(steady(1, MERGE, at=0), steady(2, [5] * 80, at=-10, frame=10)).encounters
    assert e.log is not None
    assert e.log.change_cycle.tolist() == [20]  # exactly 2 s
    np.testing.assert_allclose((e.merging_station[0], e.host_station[0]), (-30, -40))
    late = pairs(steady(1, MERGE, at=0), steady(2, [5] * 79, at=-10, frame=11))
    assert late.rejected == {"short_window": ("r-1.1-h2.1",)}


def test_a_frame_gap_ends_the_window() -> None:
    cars = [steady(1, RAMP[:12], at=0), steady(1, MERGE[13:], at=0, frame=13, part=2), steady(2, [5] * 90, at=-10)]
    assert pairs(*cars).rejected == {"short_window": ("r-1.2-h2.1",)}
    e = pairs(*cars, min_window=1.5).encounters
    assert e.log is not None
    assert (e.case.tolist(), e.log.change_cycle.tolist()) == (["r-1.2-h2.1"], [17])


def test_a_later_start_of_the_window() -> None:
    e = pairs(steady(1, MERGE, at=0), steady(2, [5] * 90, at=-10), max_window=2.5).encounters
    assert e.log is not None
    assert e.log.change_cycle.tolist() == [25]
    np.testing.assert_allclose(e.merging_station, -37.5)


def test_flicker_does_not_merge() -> None:
    flickering = RAMP + [5] * 4 + [6] * 6 + [5] * 50
    e = pairs(steady(1, flickering, at=0), steady(2, [5] * 90, at=-10)).encounters
    assert e.log is not None
    assert e.log.change_cycle.tolist() == [40]


@pytest.mark.parametrize(
    ("merging", "host", "until"),
    [
        (MERGE, [5] * 50 + [4] * 40, 49),
        (MERGE, [5] * 50 + [4] * 4 + [5] * 36, NEVER),
        (MERGE, [5] * 88 + [4] * 2, 87),  # it does not come back
        (RAMP + [5] * 30 + [4] * 30, [5] * 90, 59),
        (RAMP + [5] * 30 + [4] * 30, [5] * 50 + [4] * 40, 49),
    ],
)
def test_scoring_ends_when_a_car_leaves_the_host_lane(merging: list[int], host: list[int], until: int) -> None:
    e = pairs(steady(1, merging, at=0), steady(2, host, at=-10)).encounters
    assert e.log is not None
    assert e.log.score_until.tolist() == [until]


def test_a_host_must_be_in_the_host_lane_throughout_the_window() -> None:
    entering = pairs(steady(1, MERGE, at=0), steady(2, [4] * 5 + [5] * 85, at=-10))
    assert entering.rejected == {"host_changes_lane": ("r-1.1-h2.1",)}
    flickering = pairs(steady(1, MERGE, at=0), steady(2, [5] * 10 + [4] * 4 + [5] * 76, at=-10))
    assert len(flickering.encounters) == 1


def test_impossible_motion_within_the_window_is_rejected() -> None:
    time = np.arange(90) * DT
    fast = pairs(steady(1, MERGE, at=0), steady(2, [5] * 90, at=-90, speed=41))
    assert fast.rejected == {"too_fast": ("r-1.1-h2.1",)}
    jump = 15 * time - 10 + 5.0 * (time > 1.5)
    assert pairs(steady(1, MERGE, at=0), Car(2, [5] * 90, jump)).rejected == {"too_hard": ("r-1.1-h2.1",)}


def test_a_log_ends_where_it_jumps_after_the_change() -> None:
    time = np.arange(90) * DT
    jump = 15 * time - 10 + 5.0 * (time > 5.95)
    e = pairs(steady(1, MERGE, at=0), Car(2, [5] * 90, jump)).encounters
    assert e.log is not None
    assert 50 <= e.log.host_station.lengths[0] <= 60
    assert e.log.merging_station.lengths.tolist() == [90]
    speed = np.diff(e.log.host_station[0]) / DT
    assert np.abs(np.diff(speed) / DT).max() <= 10


def test_missing_lengths_and_smoothed_sources_are_flagged() -> None:
    cars = [steady(1, MERGE, at=0), steady(2, [5] * 90, at=-10, length=float("nan"))]
    e = pairs(*cars, steady(3, [5] * 90, at=10, smoothed=True)).encounters
    assert e.length_missing.tolist() == [True, False]
    assert e.smoothed_source.tolist() == [False, True]
    np.testing.assert_allclose(e.host_length, [5, 4])


def test_the_observed_speed_is_causal_or_raw() -> None:
    noise = 15 + np.random.default_rng(0).normal(0, 1, 90)
    merging = Car(1, MERGE, 15 * np.arange(90) * DT, speed=noise)
    host = steady(2, [5] * 85, at=-10, frame=5)
    raw, causal = (pairs(merging, host, observed=kind).encounters.log for kind in ("raw", "causal"))
    assert raw is not None
    assert causal is not None
    np.testing.assert_array_equal(raw.merging_speed[0], noise[5:])
    assert causal.merging_speed[0][0] == pytest.approx(np.polyval(np.polyfit(range(6), noise[:6], 1), 5))
    assert np.std(causal.merging_speed[0]) < np.std(noise)


def test_recordings_do_not_share_a_clock() -> None:
    paired = pairs(steady(1, MERGE, at=0, recording="a"), steady(2, [5] * 90, at=-10, recording="b"))
    assert paired.rejected == {"no_host": ("us101/a/1/1",)}


def test_no_car_at_all() -> None:
    empty: pa.Table = table(steady(1, [3] * 5, at=0)).slice(0, 0)
    for cars in (empty, table(steady(1, [3] * 5, at=0))):
        paired = extract_pairs(cars, US101, PairRules(), "ngsim")
        assert (len(paired.encounters), paired.merging_cars) == (0, 0)


def test_a_host_that_left_the_recorded_road_is_carried_on_to_the_lane_change() -> None:
    """Its log ends with the cycle of the lane change, so that what follows counts as extended."""
    cars = (steady(1, [6] * 40 + [5] * 10, at=0), steady(2, [5] * 30, at=20))
    assert pairs(*cars).rejected == {"no_host": ("us101/r/1/1",)}
    assert len(pairs(*cars, carry_on=0.9).encounters) == 0
    e = pairs(*cars, carry_on=1.1).encounters
    assert e.log is not None
    assert (e.log.change_cycle.tolist(), e.log.host_station.lengths.tolist()) == ([40], [41])
    np.testing.assert_allclose(e.log.host_station[0], 20 - 60 + 1.5 * np.arange(41), atol=1e-9)
    assert replay_logged_host(e).extended.tolist() == [True]

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from merge_cosim.ngsim.pairing.smoothing import filter_causally, smooth_position, smooth_tracks

TIME = np.arange(40) * 0.1


def test_constant_acceleration_passes_unchanged_to_the_ends() -> None:
    track = 3 + 10 * TIME + 0.7 * TIME**2
    np.testing.assert_allclose(smooth_position(track, 11, 2), track, atol=1e-10)


def test_jitter_shrinks_and_time_is_not_shifted() -> None:
    rng = np.random.default_rng(1)
    truth = 12 * np.arange(2000) * 0.1
    smooth = smooth_position(truth + rng.normal(0, 0.05, 2000), 11, 2)
    assert np.std(smooth - truth) < 0.05 * 0.5
    assert abs(np.mean(smooth - truth)) < 0.005


@pytest.mark.parametrize("length", range(1, 12))
def test_short_tracks_keep_their_length_and_a_straight_line(length: int) -> None:
    track = 5.0 + 1.5 * np.arange(length)
    np.testing.assert_allclose(smooth_position(track, 11, 2), track, atol=1e-10)


def test_a_standing_car_never_rolls_back() -> None:
    track = 7 + np.random.default_rng(2).normal(0, 0.1, 200)
    assert np.all(np.diff(smooth_position(track, 11, 2)) >= 0)


def test_nothing_leaks_from_track_to_track() -> None:
    first, second = 10 * TIME, 500 + 20 * TIME
    both = smooth_tracks(np.concatenate([first, second]), np.array([0, 40, 80]), 11, 2)
    np.testing.assert_allclose(both, np.concatenate([first, second]), atol=1e-9)
    assert len(smooth_tracks(np.empty(0), np.array([0]), 11, 2)) == 0


@given(st.lists(st.floats(0, 40), min_size=2, max_size=40), st.data())
def test_causal_filter_does_not_look_ahead(values: list[float], data: st.DataObject) -> None:
    seen = data.draw(st.integers(1, len(values)))
    whole, cut = (filter_causally(np.array(part), 11, 1) for part in (values, values[:seen]))
    np.testing.assert_allclose(whole[:seen], cut, atol=1e-9)


def test_causal_filter_follows_a_steady_acceleration_without_lag() -> None:
    np.testing.assert_allclose(filter_causally(10 + 2 * TIME, 11, 1), 10 + 2 * TIME, atol=1e-10)


def test_causal_filter_damps_white_noise_as_documented() -> None:
    noise = np.random.default_rng(3).normal(0, 1, 50_000)
    assert np.std(filter_causally(noise, 11, 1)) == pytest.approx(0.56, abs=0.01)

"""The recorder keeps the last cycles of every slot, and grows with the world."""

import numpy as np
import pytest
from cases import random_encounters

from merge_cosim.scoring.tracks import COMMAND, LOG_ODDS, RECORDED
from merge_cosim.simulation.recording import Recorder, trace_of

NO_CHANNELS = np.empty((0, 3))


def test_the_recorder_gives_back_what_went_through_it():
    recorder, encounters = Recorder(3, longest=4), random_encounters(5, seed=7)
    recorder.begun(np.arange(3), encounters.start[:, :3], NO_CHANNELS)
    history = [encounters.start[:4, :3].round(6)]
    assert (history[0] != encounters.start[:4, :3]).any()
    np.testing.assert_array_equal(recorder.seen.host_station, history[0][0])
    np.testing.assert_array_equal(recorder.seen.merging_speed, history[0][3])
    for cycle in range(1, 8):  # more cycles than it holds
        recorder.decided(np.full(3, cycle - 1.0), np.full(3, 10.0 + cycle))
        history.append((history[-1] + 1.0).round(6))
        recorder.next_cycle()[0][:] = history[-1]
    np.testing.assert_array_equal(recorder.track(1, 4)[:4], np.array(history)[-5:, :, 1].T)
    np.testing.assert_array_equal(recorder.track(1, 4)[LOG_ODDS, :-1], [3.0, 4.0, 5.0, 6.0])
    np.testing.assert_array_equal(recorder.track(1, 4)[COMMAND, :-1], [14.0, 15.0, 16.0, 17.0])
    before = recorder.track(0, 2)
    recorder.begun(np.array([1]), encounters.start[:, 4:], NO_CHANNELS[:, :1])
    np.testing.assert_array_equal(recorder.track(0, 2), before)  # the neighbours are left alone
    assert recorder.seen.host_station[1] == encounters.host_station[4].round(6)
    assert recorder.seen.host_length[1] == encounters.host_length[4]
    with pytest.raises(ValueError, match="read-only"):
        recorder.seen.host_station[0] = 0.0  # an estimator cannot change what was seen


def test_records_from_the_start_lie_end_to_end():
    recorder, rng = Recorder(4, longest=6), np.random.default_rng(1)
    for _ in range(6):
        recorder.decided(*rng.random((2, 4)))
        recorder.next_cycle()[0][:] = rng.random((4, 4))
    ends = np.array([5, 2, 6])
    expected = [recorder.track(1 + number, 6)[:, : end + 1] for number, end in enumerate(ends.tolist())]
    np.testing.assert_array_equal(recorder.from_the_start(slice(1, 4), ends), np.concatenate(expected, axis=1))


def test_growing_keeps_the_record():
    small, large = Recorder(2, longest=3, channels=1), Recorder(4, longest=20, channels=1)
    for cycle in range(10):
        small.make_room(2 if cycle < 5 else 4, longest=cycle + 1)
        for recorder in (small, large):
            state, around = recorder.next_cycle()
            state[:, :2], around[:, :2] = cycle, -cycle
    assert small.lengths.shape == (2, 4)
    np.testing.assert_array_equal(small.track(1, 9), large.track(1, 9))


def test_a_trace_has_a_row_per_decision():
    track = np.zeros((RECORDED + 1, 4))
    track[2] = [10.0, 10.2, 10.4, 10.6]
    track[COMMAND] = [10.2, 10.4, 10.6, 0.0]
    track[LOG_ODDS] = [-1.0, 0.0, 2.0, 0.0]
    track[RECORDED] = [7.0, 6.0, 5.0, 4.0]
    trace = trace_of(track, ("leader_gap_m",), begun_at=12.0)
    assert trace["time_s"].tolist() == [12.0, 12.1, 12.2]
    assert trace["host_acceleration_m_s2"].tolist() == pytest.approx([2.0, 2.0, 2.0])
    assert trace["not_yield"].tolist() == [0.0, 1.0, 1.0]
    assert trace["leader_gap_m"].tolist() == [7.0, 6.0, 5.0]

"""What is counted of logged pairs, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from merge_cosim.core.encounter import NEVER, Encounters, Intention, Ragged, ReplayLog
from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.fitting import fit, transitions

CYCLES = (40, 90)
"""Lane changes of the two pairs."""


def pairs() -> Encounters:
    """Two pairs whose merging cars brake by 1 and 2 m/s^2 to 10 m/s at their lane changes, hosts 20 m behind them."""
    ways = [np.arange(cycle + 21) - float(cycle) for cycle in CYCLES]
    ways = [way + factor * way * np.abs(way) for way, factor in zip(ways, (0.005, 0.01), strict=True)]
    log = ReplayLog(
        merging_station=Ragged.of(ways),
        merging_speed=Ragged.of([np.full(len(way), 7.0) for way in ways]),
        host_station=Ragged.of([way - 20.0 for way in ways]),
        change_cycle=np.array(CYCLES),
        score_until=np.full(2, NEVER),
    )
    start = {"host_station": -60.0, "host_speed": 10.0, "merging_station": -40.0, "merging_speed": 10.0}
    made = Encounters.unlogged(np.array(["a", "b"]), "us101", "ngsim", **start, host_length=5.0, merging_length=5.0)
    return replace(made, car=np.array(["x", "y"]), label=np.array([Intention.YIELD, Intention.NOT_YIELD]), log=log)


def test_transitions_run_from_the_windows_start_to_the_lane_change():
    before, now, label = transitions(pairs(), lag=1)
    assert np.bincount(label).tolist() == [cycle - 1 for cycle in CYCLES]  # n speeds are n - 1 transitions
    change = np.where(label == Intention.YIELD, -0.1, -0.2)  # from the first difference on
    np.testing.assert_allclose(now - before, change, atol=1e-9)
    assert len(transitions(pairs(), lag=10)[0]) == sum(CYCLES) - 20
    assert (transitions(pairs(), lag=1, observed=True)[0] == 7.0).all()


def test_every_pair_has_the_same_weight_in_the_times_to_arrival():
    model = fit(pairs(), "m", {})
    np.testing.assert_allclose(model.arrivals.shares.sum(axis=(1, 2)), 1.0)
    assert model.pairs.tolist() == [1, 1]
    assert model.trained_on == ("x", "y")
    assert model.merge_speed == pytest.approx((10.05 + 10.1) / 2)


def test_both_intentions_are_needed():
    with pytest.raises(UserError, match="1 yielding and 0 not yielding pairs"):
        fit(pairs().take(np.array([0])), "m", {})
    steady = pairs()
    steady.log.merging_station.values[:] = np.arange(len(steady.log.merging_station.values))
    with pytest.raises(UserError, match="1 different speed transitions of YIELD"):
        fit(steady, "m", {})
    with pytest.raises(UserError, match="training needs logged encounters"):
        fit(replace(pairs(), log=None), "m", {})


def test_frames_of_long_times_to_arrival_are_counted_in_the_last_bin():
    slow = pairs()
    slow.log.host_station.values[:] *= 3.0  # the hosts are up to 300 m away: 20 s and more at their speeds
    slow.log.host_station.values[:] -= 400.0
    shares = fit(slow, "m", {}).arrivals.shares
    np.testing.assert_allclose(shares.sum(axis=(1, 2)), 1.0)
    assert shares[:, :, -1].sum() > 0.1

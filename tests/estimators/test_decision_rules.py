"""The rules without learning: acc, slot, slot-time and the references, against hand-computed cases."""

import numpy as np
import pytest

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.acc import AccMerging
from merge_cosim.estimators.references import AlwaysGo, AlwaysYield, OracleLabel
from merge_cosim.estimators.slot import Slot, SlotTime


def decide(estimator, host, merging, label=0, length=5.0):
    estimator.start(1, Setting())
    estimator.reset(np.array([0]), np.array([label]), np.zeros(1, dtype=np.uint64))
    one = np.array
    log_odds = estimator.update(
        Observation(one([host[0]]), one([host[1]]), one([merging[0]]), one([merging[1]]), one([length]), one([length]))
    )
    assert not np.isnan(log_odds).any()
    return "N" if log_odds[0] >= 0 else "Y"


@pytest.mark.parametrize(
    ("host", "merging", "expected"),
    [(-50.0, -49.0, "N"), (-50.0, -50.0, "N"), (-50.0, -50.0 - 5e-7, "N"), (-50.0, -50.1, "Y")],
)
def test_acc_goes_by_station(host, merging, expected):
    assert decide(AccMerging(), (host, 10.0), (merging, 10.0)) == expected


@pytest.mark.parametrize(
    ("host", "merging", "expected"),
    [
        ((-100.0, 10.0), (-50.0, 10.0), "N"),  # arrives 5 s later: would stand 50 m upstream, the slot behind is free
        ((-50.0, 10.0), (-100.0, 10.0), "Y"),  # arrives 5 s sooner: 50 m past, the slot ahead is free
        ((-100.0, 10.0), (-100.0, 10.0), "N"),  # a tie: ahead and behind need the same 2 * 7 / 10^2
        ((-100.0 + 5e-7, 10.0), (-100.0, 10.0), "N"),  # still a tie
        ((-99.0, 10.0), (-100.0, 10.0), "Y"),  # a metre ahead: 2 * 6 / 10^2 against 2 * 8 / 10^2
        ((-101.0, 10.0), (-100.0, 10.0), "N"),
        ((-10.0, 10.0), (-10.5, 10.0), "N"),  # 1.05 s left: ahead needs 11.8 > 2 m/s^2, none is feasible
    ],
)
def test_slot_takes_the_cheaper_feasible_slot(host, merging, expected):
    assert decide(Slot(), host, merging) == expected


def test_slot_behind_wins_where_only_it_is_feasible():
    # T = 4 s; the host is projected to s = 1: ahead needs 2 * 6 / 16 = 0.75, behind 2 * 8 / 16 = 1.0
    assert decide(Slot(), (-39.0, 10.0), (-40.0, 10.0)) == "Y"
    assert decide(Slot(max_acceleration=0.7), (-39.0, 10.0), (-40.0, 10.0)) == "N"


@pytest.mark.parametrize(
    ("host", "merging", "expected"),
    [((-50.0, 10.0), (-40.0, 10.0), "N"), ((-40.0, 10.0), (-50.0, 10.0), "Y"), ((-50.0, 10.0), (-100.0, 20.0), "N")],
)
def test_slot_time_goes_by_arrival(host, merging, expected):
    assert decide(SlotTime(), host, merging) == expected


def test_references_never_change_their_mind():
    for host in (-100.0, -10.0, 5.0):
        assert decide(AlwaysGo(), (host, 10.0), (-50.0, 10.0)) == "Y"
        assert decide(AlwaysYield(), (host, 10.0), (-50.0, 10.0)) == "N"
        assert decide(OracleLabel(), (host, 10.0), (-50.0, 10.0), label=1) == "N"
        assert decide(OracleLabel(), (host, 10.0), (-50.0, 10.0), label=0) == "Y"

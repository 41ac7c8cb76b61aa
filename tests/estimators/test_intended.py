"""Accelerations of either intention, by hand."""

import numpy as np
import pytest

from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation
from merge_cosim.estimators.intended import IntendedAcceleration


def seen(host, merging):
    return Observation(*(np.array([value]) for value in (*host, *merging, 5.0, 5.0)))


def test_fixed_means_do_not_depend_on_the_cars():
    means = IntendedAcceleration(mean_yield=-1.0, mean_not_yield=0.25).intended(seen((-60.0, 20.0), (-40.0, 15.0)), 0.1)
    assert means.tolist() == [[-1.0], [0.25]]


def test_means_by_arrival_bring_the_car_there_before_or_after_the_host():
    law = IntendedAcceleration(means="arrival", tau=1.0)
    found = law.intended(seen((-60.0, 20.0), (-40.0, 12.0)), 0.1)  # the host arrives after 3 s
    after, before = found[Intention.YIELD, 0], found[Intention.NOT_YIELD, 0]
    assert after == pytest.approx(2 * (40.0 - 12.0 * 4.0) / 16.0)
    assert before == 2.0  # 2 (40 - 24) / 4 = 8 is more than the bound
    assert 12.0 * 4.0 + after * 8.0 == pytest.approx(40.0)


def test_a_car_that_would_roll_back_stops_at_the_merging_point():
    law = IntendedAcceleration(means="arrival", tau=1.0)
    found = law.intended(seen((-60.0, 10.0), (-20.0, 8.0)), 0.1)  # the host arrives after 6 s, 56 m of way at 8 m/s
    assert found[Intention.YIELD, 0] == pytest.approx(-(8.0**2) / 40.0)

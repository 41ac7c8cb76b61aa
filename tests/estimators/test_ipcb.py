"""iPCB's estimate and the accelerations it rests on, against values computed by hand."""

from dataclasses import replace

import numpy as np
import pytest

from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.ipcb import Ipcb
from merge_cosim.estimators.learned.model import IntentionModel

MODEL = IntentionModel.load("us101-ngsim")
PRIOR = MODEL.prior_log_odds


def seen(speed, merging=-50.0, host=-50.0, host_speed=10.0):
    def one(value):
        return np.array([float(value)])

    return Observation(one(host), one(host_speed), one(merging), one(speed), one(5), one(5))


def ready(**parameters):
    estimator = Ipcb(**parameters)
    estimator.use(MODEL)
    estimator.start(1, Setting())
    estimator.reset(np.array([0]), np.array([-1]), np.zeros(1, dtype=np.uint64))
    return estimator


def test_the_prior_stands_alone_until_there_is_an_acceleration():
    estimator = ready()
    assert estimator.update(seen(10.0))[0] == pytest.approx(PRIOR)
    estimator.update(seen(12.0))
    estimator.reset(np.array([0]), np.array([-1]), np.zeros(1, dtype=np.uint64))
    assert estimator.update(seen(10.0))[0] == pytest.approx(PRIOR)


def test_log_odds_with_fixed_means():
    estimator = ready()
    estimator.update(seen(10.0))
    # a = +0.2: ((0.2 + 0.5)^2 - (0.2 - 0.5)^2) / (2 * 0.25) = (0.49 - 0.09) / 0.5
    assert estimator.update(seen(10.02))[0] == pytest.approx(0.8 + PRIOR)
    # a = -1.0: (0.25 - 2.25) / 0.5; of the cycle before nothing remains
    assert estimator.update(seen(9.92))[0] == pytest.approx(-4.0 + PRIOR)
    assert ready(sigma=1.0).update(seen(9.92))[0] == pytest.approx(PRIOR)


def test_means_by_arrival():
    estimator = ready(means="arrival")
    # the host needs 5 s; 50 m in 6.5 s: 2 (50 - 65) / 42.25; in 3.5 s: 2 (50 - 35) / 12.25, beyond the bound
    mean = estimator.intended(seen(10.0), 0.1)[:, 0]
    assert mean[Intention.YIELD] == pytest.approx(-30 / 42.25)
    assert mean[Intention.NOT_YIELD] == pytest.approx(2.0)
    estimator.update(seen(10.0))
    # a = +0.3, now at 10.03 m/s: 2 (50 - 65.195) / 42.25
    off_yield, off_not_yield = 0.3 + 30.39 / 42.25, 0.3 - 2.0
    assert estimator.update(seen(10.03))[0] == pytest.approx((off_yield**2 - off_not_yield**2) / 0.5 + PRIOR)


def test_means_by_arrival_stop_at_the_merging_point_rather_than_roll_back():
    estimator = ready(means="arrival")
    # 20 m left at 10 m/s with 6.5 s to lose: 65 m > 2 * 20 m, so stop in 20 m: -100 / 40
    mean = estimator.intended(seen(10.0, merging=-20.0), 0.1)[:, 0]
    assert mean[Intention.YIELD] == pytest.approx(-2.5)
    hard = estimator.intended(seen(20.0, merging=-20.0), 0.1)[:, 0]
    assert hard[Intention.YIELD] == pytest.approx(-4.0)


@pytest.mark.parametrize("speed", [0.0, 15.0])
@pytest.mark.parametrize("station", [0.0, 10.0])
def test_means_by_arrival_are_finite_past_the_merging_point(speed, station):
    past = seen(speed, merging=station, host=station)
    mean = ready(means="arrival", tau=0.0).intended(past, 0.1)
    assert np.isfinite(mean).all()
    assert (np.abs(mean) <= 4.0).all()


def test_fixed_means_do_not_depend_on_where_the_cars_are():
    here, there = seen(10.0), replace(seen(10.0), merging_station=np.array([-5.0]))
    np.testing.assert_array_equal(ready().intended(here, 0.1), ready().intended(there, 0.1))

"""PGM-G: PGM with its speed term replaced, and nothing else."""

import numpy as np
import pytest
from small import begin, seen, small_gaussian, small_model

from merge_cosim.estimators.pgm import Pgm
from merge_cosim.estimators.pgm_g import PgmG


def test_the_speed_term_by_hand():
    model = small_model()
    estimator = begin(PgmG(time_weight=0.0, alpha=0.5), model)
    assert estimator.update(seen(12.0))[0] == pytest.approx(np.log(1 / 2))
    # 12.0 -> 12.1: two sigma off under N(12.3, 0.1), one sigma off under N(11.9, 0.2)
    once = (-np.log(0.1) - 2.0) - (-np.log(0.2) - 0.5)
    assert estimator.update(seen(12.1))[0] == pytest.approx(0.5 * once + np.log(1 / 2))
    twice = small_gaussian().log_ratio(np.array([12.1]), np.array([12.6]))[0]
    assert estimator.update(seen(12.6))[0] == pytest.approx(0.5 * (once + twice) + np.log(1 / 2))


def test_time_and_prior_are_pgms():
    now = seen(12.0, merging=-30.0, host=-80.0)
    assert begin(PgmG(), small_model()).update(now) == begin(Pgm(), small_model()).update(now)


def test_the_floor_is_settable():
    narrow, wide = (begin(PgmG(min_sigma=floor, time_weight=0.0), small_model()) for floor in (0.05, 10.0))
    for estimator in (narrow, wide):
        estimator.update(seen(12.0))
    assert abs(wide.update(seen(12.6))[0] - np.log(1 / 2)) < 0.1
    assert narrow.update(seen(12.6))[0] > 1.0

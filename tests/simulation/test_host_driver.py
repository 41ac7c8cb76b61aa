"""A driver takes no nonsense from its parts."""

from dataclasses import dataclass

import numpy as np
import pytest

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import Controller
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.base import Estimator
from merge_cosim.estimators.references import AlwaysGo
from merge_cosim.simulation.host_driver import HostDriver

SEEN = Observation(*np.array([[-80.0, -60.0], [25.0, 24.0], [-70.0, -90.0], [20.0, 21.0], [5.0, 5.0], [4.0, 4.0]]))


@dataclass(kw_only=True)
class Belief(Estimator):
    """Believes what it was given."""

    values: np.ndarray

    def update(self, seen):
        return self.values


@dataclass(kw_only=True)
class Command(Controller):
    """Commands what it was given."""

    values: np.ndarray

    def command(self, seen, log_odds, target):
        return self.values


def decided(estimator, controller):
    driver = HostDriver(estimator, controller)
    driver.start(2, Setting())
    driver.reset(np.arange(2), np.zeros(2, dtype=int), np.zeros(2, dtype=np.uint64))
    return driver.decide(SEEN)


def test_certainty_is_a_number():
    log_odds, acceleration = decided(Belief(values=np.array([np.inf, -np.inf])), Acc())
    assert log_odds.tolist() == [np.inf, -np.inf]
    assert np.isfinite(acceleration).all()


@pytest.mark.parametrize(
    ("values", "amiss"),
    [
        (
            np.array([0.0, np.nan]),
            "gives NaN for a host at -60.00 m and 24.00 m/s, a merging car at -90.00 m",
        ),
        (np.float64(1.0), r"gives shape \(\) where shape \(2,\) is due"),
        (np.ones((2, 2)), r"gives shape \(2, 2\) where shape \(2,\) is due"),
    ],
)
def test_what_is_no_number_for_each_is_refused(values, amiss):
    with pytest.raises(UserError, match=f"Belief: {amiss}"):
        decided(Belief(values=values), Acc())
    with pytest.raises(UserError, match=f"Command: {amiss}"):
        decided(AlwaysGo(), Command(values=values))

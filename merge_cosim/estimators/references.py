"""References that bound what an estimator can do: constant decisions, and one that reads the label."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.units import TOLERANCE, FloatArray, IntArray
from merge_cosim.estimators.base import Estimator, certain, estimators


@estimators.register
@dataclass(kw_only=True)
class AlwaysGo(Estimator):
    """Assumes YIELD for every driver, so the host drives freely until a car is in the lane ahead."""

    name: ClassVar[str] = "always-go"
    memory = ()

    def update(self, seen: Observation) -> FloatArray:
        """YIELD in every cycle."""
        return np.full(len(seen.host_station), -np.inf)


@estimators.register
@dataclass(kw_only=True)
class AlwaysYield(Estimator):
    """Assumes NOT_YIELD for every driver, so the host keeps distance to every merging car."""

    name: ClassVar[str] = "always-yield"
    memory = ()

    def update(self, seen: Observation) -> FloatArray:
        """NOT_YIELD in every cycle."""
        return np.full(len(seen.host_station), np.inf)


@estimators.register
@dataclass(kw_only=True)
class AlwaysBrake(AlwaysYield):
    """Brakes fully: the host never fails and never arrives."""

    name: ClassVar[str] = "always-brake"
    default_controller: ClassVar[str] = "brake"


@estimators.register
@dataclass(kw_only=True)
class OracleLabel(Estimator):
    """Reads the label. Not a bound: the host's own driving may change the order.

    Where a case has no label (a scripted driver that ignores the host) the car that arrives first goes first, as in
    `slot-time`.
    """

    name: ClassVar[str] = "oracle-label"
    memory = ("_labels",)
    needs_label: ClassVar[bool] = True

    def start(self, count: int, setting: Setting) -> None:
        """Make room for the labels."""
        super().start(count, setting)
        self._labels = np.full(count, int(Intention.YIELD))

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Set the labels of the new encounters."""
        self._labels[rows] = labels

    def update(self, seen: Observation) -> FloatArray:
        """The label, from the first cycle to the last."""
        first = seen.merging_arrival - seen.host_arrival <= TOLERANCE
        return certain(np.where(self._labels == Intention.UNKNOWN, first, self._labels == Intention.NOT_YIELD))

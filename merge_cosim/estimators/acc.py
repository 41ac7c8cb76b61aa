"""ACC merging: the car nearer to the merging point goes first."""

from dataclasses import dataclass
from typing import ClassVar

from merge_cosim.core.observation import Observation
from merge_cosim.core.units import FloatArray
from merge_cosim.estimators.base import Estimator, certain, estimators


@estimators.register
@dataclass(kw_only=True)
class AccMerging(Estimator):
    """NOT_YIELD iff the merging car is not behind the host, `s_m - s_h >= -tol` (Dong, Dolan, Litkouhi 2017)."""

    name: ClassVar[str] = "acc"
    memory = ()

    def update(self, seen: Observation) -> FloatArray:
        """Compare the stations."""
        return certain(seen.merging_ahead)

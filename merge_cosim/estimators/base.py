"""The base class of estimators: from an observation to the log-odds of NOT_YIELD."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, TypeVar

import numpy as np

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import Keys
from merge_cosim.core.registry import Component, Registry
from merge_cosim.core.units import BoolArray, FloatArray, IntArray
from merge_cosim.estimators.learned.model import IntentionModel


class Estimator(Component):
    """Estimates whether the merging driver yields, for a batch of encounters at once; parameters are dataclass fields.

    Work per cycle must not grow with the history, and each encounter's result must not depend on its neighbours in
    the batch: no matrix products and no sums along the batch axis.

    Attributes:
        default_controller: Controller of a method that is named by its estimator only.
        needs_model: `use` must be called with a trained model before `start`.
        needs_label: It looks at the label, so it is a reference and no method.
    """

    default_controller: ClassVar[str] = "acc"
    needs_model: ClassVar[bool] = False
    needs_label: ClassVar[bool] = False

    def use(self, model: IntentionModel) -> None:
        """Set the model that was learned from data."""

    def start(self, count: int, setting: Setting) -> None:
        """Make room for a batch of `count` encounters and forget everything before."""
        self.setting = setting

    def reset(self, rows: IntArray, labels: IntArray, keys: Keys) -> None:
        """Forget the encounters at `rows` of the batch; new ones begin there.

        Args:
            rows: Where they begin, shape (m,).
            labels: Their intentions by the log or the script (`Intention`); for references only. Shape (m,).
            keys: Key of each one's random stream (`merge_cosim.core.random_streams`), shape (m,).
        """

    def rest(self, rows: IntArray) -> None:
        """The encounters at `rows`, shape (m,), are over: until `reset`, their values of `update` are arbitrary."""

    @abstractmethod
    def update(self, seen: Observation) -> FloatArray:
        """Take in one cycle and return `log P(NOT_YIELD) - log P(YIELD)`, shape (n,); +-inf for a rule, never NaN."""


estimators: Registry[Estimator] = Registry("estimator", "merge_cosim.estimators", Estimator)

E = TypeVar("E", bound=Estimator)


def estimator(cls: type[E]) -> type[E]:
    """Class decorator: make a class an estimator that is known by its name; its annotated attributes are parameters."""
    estimators.register(cls)
    return cls


_CERTAIN = np.array([-np.inf, np.inf])


def certain(not_yield: BoolArray) -> FloatArray:
    """Log-odds of a rule without probabilities: +inf where NOT_YIELD, -inf where YIELD."""
    return _CERTAIN.take(not_yield)

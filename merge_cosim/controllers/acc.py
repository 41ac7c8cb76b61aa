"""Adaptive cruise control: keep distance to the merging car when it is the target, else drive freely."""

from dataclasses import dataclass
from typing import ClassVar

from merge_cosim.controllers.base import controllers
from merge_cosim.controllers.following import Following
from merge_cosim.controllers.law import DistanceKeeping


@controllers.register
@dataclass(kw_only=True)
class Acc(DistanceKeeping, Following):
    """The papers' off-the-shelf distance keeping (Dong, Dolan, Litkouhi 2017); see `DistanceKeeping`."""

    name: ClassVar[str] = "acc"
    memory = ()

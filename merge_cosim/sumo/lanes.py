"""What SUMO's lanes mean on a ramp: how far along, and whether a car on them is in the host lane or yet to merge."""

from __future__ import annotations

import re
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

from merge_cosim.ramps.ramp import Ramp

_TILE = re.compile(r"(t\d+)\.(.+)")


class Part(Enum):
    """Which part of the ramp a lane belongs to."""

    HOST = "host"
    MERGING = "merging"
    BESIDE = "beside"
    """Another lane of the main road."""


class RampLane(NamedTuple):
    """A lane of a ramp.

    Attributes:
        copy: Prefix of the copy of the ramp in a net of several; empty in the ramp's own net.
        start: x of its edge's start [m past the gore].
        part: What it is for an encounter.
    """

    copy: str
    start: float
    part: Part


class _Joint(NamedTuple):
    """The last edge before the gore and the first one after it, on both paths."""

    by_main: tuple[str, str]
    by_ramp: tuple[str, str]


class RampLanes:
    """Finds the meaning of a SUMO lane by its id; None for one off the ramp's two paths."""

    def __init__(self, ramp: Ramp) -> None:
        self._ramp = ramp
        self._known: dict[str, RampLane | None] = {}

    def __getitem__(self, lane: str) -> RampLane | None:
        if lane not in self._known:
            self._known[lane] = self._find(lane)
        return self._known[lane]

    def comes_by_ramp(self, route: tuple[str, ...]) -> bool:
        """Whether a route leads over the on-ramp to the main road."""
        return self._joint.by_ramp in self._pairs(route)

    def comes_by_main(self, route: tuple[str, ...]) -> bool:
        """Whether a route leads along the main road past the gore."""
        return self._joint.by_main in self._pairs(route)

    def _pairs(self, route: tuple[str, ...]) -> set[tuple[str, str]]:
        """Every two edges that follow one another, by their own ids."""
        return set(pairwise(self._plain(edge)[1] for edge in route))

    @cached_property
    def _joint(self) -> _Joint:
        gore = next(section.edge for section in self._ramp.main if section.start >= 0.0)
        before, link = ([one.edge for one in path if one.end <= 0.0][-1] for path in (self._ramp.main, self._ramp.ramp))
        return _Joint((before, gore), (link, gore))

    @cached_property
    def _edges(self) -> frozenset[str]:
        return frozenset(section.edge for section in self._ramp.main + self._ramp.ramp)

    @cached_property
    def _own_edges(self) -> frozenset[str]:
        return frozenset(section.edge for section in self._ramp.ramp) - set(self._ramp.main_route)

    def _plain(self, name: str) -> tuple[str, str]:
        """Prefix of the copy and the edge's own id."""
        tile = _TILE.fullmatch(name)
        return ("", name) if tile is None or name in self._edges else (tile[1], tile[2])

    def _find(self, lane: str) -> RampLane | None:
        name, _, index = lane.rpartition("_")
        copy, edge = self._plain(name)
        for section in self._ramp.ramp:
            if section.edge == edge and (edge in self._own_edges or section.lane == int(index)):
                return RampLane(copy, section.start, Part.MERGING)
        for section in self._ramp.main:
            if section.edge == edge:
                return RampLane(copy, section.start, Part.HOST if section.lane == int(index) else Part.BESIDE)
        return None

"""Where SUMO's lanes lie on a ramp: from lane and position to x or a station, and back."""

from __future__ import annotations

import re
from collections.abc import Sequence
from enum import Enum
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.ramps.ramp import Ramp, Way

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
        part: Its part of the ramp.
    """

    copy: str
    start: float
    part: Part


class LanePosition(NamedTuple):
    """A place in the net: the front bumper at `position` metres from the start of lane `lane` of `edge`."""

    edge: str
    lane: int
    position: float


class _Joint(NamedTuple):
    """The last edge before the gore and the first one after it, on both paths."""

    by_main: tuple[str, str]
    by_ramp: tuple[str, str]


class LaneMap(dict[str, RampLane | None]):
    """The lanes of a ramp's two paths. All lanes of an edge share one coordinate x [m past the gore].

    `lane_map[lane]` is the `RampLane` of a SUMO lane by its id, also in a net of copies; None off the two paths.
    """

    def __init__(self, ramp: Ramp) -> None:
        self._ramp = ramp
        self._starts = {section.edge: section.start for section in ramp.main + ramp.ramp}

    def __missing__(self, lane: str) -> RampLane | None:
        found = self[lane] = self._find(lane)
        return found

    def start(self, edge: str) -> float:
        """X where an edge starts [m]; an edge off the two paths is the off-ramp, from the auxiliary lane's end on."""
        return self._starts.get(edge, self._ramp.auxiliary_end)

    def merging_lane(self, edge: str) -> int:
        """SUMO index of the auxiliary lane on an edge; beyond its end that of the host's lane."""
        return next((section.lane for section in self._ramp.ramp if section.edge == edge), self.host_lane(edge))

    def host_lane(self, edge: str) -> int:
        """SUMO index of the host's lane on an edge of the main road."""
        for section in self._ramp.main:
            if section.edge == edge:
                return section.lane
        named = ", ".join(self._ramp.main_route)
        raise ValueError(f"{self._ramp.name}: '{edge}' is no edge of the main road; these are {named}")

    def place(self, path: Way, station: float, merge_position: float) -> LanePosition:
        """Where a front bumper at `station` [m] lies in the net.

        On the path `ramp` that is the on-ramp, then the auxiliary lane, and from station 0 on the host lane.

        Raises:
            UserError: The place or the merging point is off the net; the line names the reach.
        """
        ramp, x = self._ramp, station + merge_position
        if not 0.0 <= merge_position <= ramp.auxiliary_end:
            raise UserError(
                f"ramp {ramp.name}: the merging point {merge_position:.1f} m past the gore is off the auxiliary lane "
                f"(0 ... {ramp.auxiliary_end:.1f} m)"
            )
        ahead_of_change = path == "ramp" and (x < 0.0 or (station < 0.0 and ramp.changes_lane))
        for section in reversed(ramp.ramp if ahead_of_change else ramp.main):
            if section.start <= x <= section.end:
                return LanePosition(section.edge, section.lane, x - section.start)
        start = (ramp.ramp if path == "ramp" else ramp.main)[0].start
        raise UserError(
            f"ramp {ramp.name}: station {station:.1f} m on the path '{path}' is off the net, which reaches from "
            f"{start - merge_position:.1f} to {ramp.downstream - merge_position:.1f} m"
        )

    def station(self, where: LanePosition, merge_position: float) -> float:
        """Station [m] of a front bumper on any lane of a path's edge; the inverse of `place`.

        Raises:
            ValueError: The edge is on neither path.
        """
        if where.edge not in self._starts:
            named = ", ".join(dict.fromkeys(self._ramp.main_route + self._ramp.ramp_route))
            raise ValueError(
                f"ramp {self._ramp.name}: '{where.edge}' (lane {where.lane}) is on neither path; these have {named}"
            )
        return self._starts[where.edge] + where.position - merge_position

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
    def _own_edges(self) -> frozenset[str]:
        return frozenset(section.edge for section in self._ramp.ramp) - set(self._ramp.main_route)

    def _plain(self, name: str) -> tuple[str, str]:
        """Prefix of the copy and the edge's own id."""
        tile = _TILE.fullmatch(name)
        return ("", name) if tile is None or name in self._starts else (tile[1], tile[2])

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


class AlongPaths:
    """x of many cars that drive along the two paths, from their lane positions.

    The first half of the rows drive on one of the paths, the second half on the other. Cars never back up, so a lane
    position that has become smaller is on the next edge.
    """

    def __init__(self, ramp: Ramp, count: int, paths: tuple[Way, Way] = ("main", "ramp")) -> None:
        """Start with all cars on the first edges; `count` is the number of cars on each of the paths."""
        lanes, routes = LaneMap(ramp), [ramp.route(path) for path in paths]
        self._starts = np.array([lanes.start(edge) for route in routes for edge in route])
        before = (0, len(routes[0]))
        self._numbers = [{edge: first + i for i, edge in enumerate(r)} for first, r in zip(before, routes, strict=True)]
        self._edge = np.repeat(before, count)
        self._edge_start = self._starts[self._edge]
        self._position = np.zeros(2 * count)

    def numbers(self, path: int, where: Sequence[LanePosition]) -> list[int]:
        """The numbers by which `put` knows the edges of some places on a path, 0 or 1."""
        return [self._numbers[path][one.edge] for one in where]

    def put(self, rows: IntArray, edges: IntArray, positions: FloatArray) -> None:
        """Note that cars were placed, one at each of `rows`: on edges, by their numbers, and lane positions [m]."""
        self._edge[rows] = edges
        self._edge_start[rows] = self._starts[edges]
        self._position[rows] = positions

    def x(self, position: FloatArray, rows: IntArray | None = None) -> FloatArray:
        """X of all cars [m], shape (2 count,), from their lane positions after a step.

        Args:
            position: Lane positions [m], shape (2 count,), or of the cars at `rows` alone: the others stand.
            rows: Those cars; None for all.
        """
        if rows is not None:
            held = self._position.copy()
            held[rows] = position
            position = held
        crossed = (position < self._position).nonzero()[0]  # a quarter of the time of np.flatnonzero
        if len(crossed):
            edge = self._edge[crossed] + 1
            self._edge[crossed] = edge
            self._edge_start[crossed] = self._starts[edge]
        self._position = position
        return position + self._edge_start

"""Where a recording's lanes lie in a ramp's net: from lane number and x to SUMO's lane and position, and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.ramps.definition import FILE_NAME
from merge_cosim.ramps.ramp import Ramp, read_net
from merge_cosim.sumo.lane_map import LaneMap


class Strip(NamedTuple):
    """A SUMO lane as a piece of one of the recording's lanes.

    Attributes:
        lane: The recording's number, that of the first on-ramp lane for all lanes beside the main road.
        edge: SUMO's edge.
        lane_index: Index of the lane on it.
        start: x of its start [m past the gore].
        end: x of its end [m past the gore].
    """

    lane: int
    edge: str
    lane_index: int
    start: float
    end: float

    @property
    def id(self) -> str:
        """SUMO's id of the lane."""
        return f"{self.edge}_{self.lane_index}"


class LoggedRoad:
    """All strips of a recorded ramp, laid along the road by `ngsim.lanes` of its `ramp.toml`.

    Attributes:
        strips: Sorted by lane and start.
        side_lane: Number of the lanes beside the main road.
    """

    def __init__(self, ramp: Ramp, ramp_lanes: Sequence[int], exit_lanes: Sequence[int], host_lane: int) -> None:
        """Read a ramp.

        Args:
            ramp: The ramp.
            ramp_lanes: The recording's numbers of the lanes from which cars merge.
            exit_lanes: Those of the lanes that go on from these to an off-ramp.
            host_lane: That of the lane that cars merge into.

        Raises:
            UserError: The ramp's file has no table of a recording's lanes.
        """
        if ramp.ngsim is None:
            raise UserError(f"{ramp.net.parent / FILE_NAME}: no [ngsim] table says where logged lanes lie in the net")
        net, lanes = read_net(ramp.net), LaneMap(ramp)
        strips = []
        for number, along in ramp.ngsim.lanes.items():
            lane = ramp_lanes[0] if number in (*ramp_lanes, *exit_lanes) else number
            for name in along:
                edge, _, index = name.rpartition("_")
                start = lanes.start(edge)
                strips.append(Strip(lane, edge, int(index), start, start + float(net.getEdge(edge).getLength())))
        self.strips = sorted(strips, key=lambda strip: (strip.lane, strip.start))
        self.side_lane = ramp_lanes[0]
        self._host_lane = host_lane
        self._has_exit = bool(exit_lanes)
        self._ramp = ramp
        self._by_id = {strip.id: strip for strip in self.strips}
        self._follows = {
            (one.edge, other.edge)
            for one, other in zip(self.strips, self.strips[1:], strict=False)
            if one.lane == other.lane
        }

    def find(self, lane: IntArray, x: FloatArray) -> IntArray:
        """Number of the strip at each place.

        A car in the side lane beyond its end, where no off-ramp goes on from it, counts as in the lane beside it.

        Args:
            lane: The recording's lane numbers, those beside the main road with the number of the first on-ramp lane.
            x: Front bumpers [m past the gore], same shape.

        Raises:
            UserError: A place is off the net.
        """
        found = np.full(len(x), -1, dtype=np.int64)
        for number in np.unique(lane).tolist():
            rows = np.flatnonzero(lane == number)
            found[rows] = self._along(number, x[rows])
        beyond = np.flatnonzero((found < 0) & (lane == self.side_lane))
        found[beyond] = self._along(self._host_lane, x[beyond])
        for row in np.flatnonzero(found < 0)[:1]:
            raise UserError(f"ramp {self._ramp.name}: lane {lane[row]} at {x[row]:.1f} m past the gore is off the net")
        return found

    def at(self, lane_id: str) -> Strip | None:
        """The strip of a SUMO lane; None off all strips."""
        return self._by_id.get(lane_id)

    def drivable(self, one: Strip, other: Strip) -> bool:
        """Whether a car can get from one strip to the other: along an edge's lanes, or to the next edge."""
        return one.edge == other.edge or (one.edge, other.edge) in self._follows

    def onward(self, strip: Strip, from_ramp: bool) -> tuple[str, ...]:
        """Edges after a strip's: to the end of the main road, or of the off-ramp from its lane (unless `from_ramp`)."""
        leaves = strip.lane == self.side_lane and not from_ramp and self._has_exit
        side = tuple(each.edge for each in self.strips if each.lane == self.side_lane)
        for route in (side,) if leaves else (self._ramp.main_route, self._ramp.ramp_route):
            if strip.edge in route:
                return route[route.index(strip.edge) + 1 :]
        return ()

    def _along(self, lane: int, x: FloatArray) -> IntArray:
        """Number of the strip of one lane at each x [m], -1 off its ends; a place between two belongs to the second."""
        first = next((k for k, strip in enumerate(self.strips) if strip.lane == lane), 0)
        own = [strip for strip in self.strips if strip.lane == lane]
        starts = np.array([strip.start for strip in own])
        found = np.searchsorted(starts, x, side="right") - 1
        ends = np.array([strip.end for strip in own])
        on = (found >= 0) & (x <= ends[found]) if own else np.zeros(len(x), dtype=bool)
        return np.where(on, first + found, -1)

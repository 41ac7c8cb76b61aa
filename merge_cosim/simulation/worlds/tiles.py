"""Worlds, which move the cars of a batch: SUMO on tiles of the ramp, and the closed form as its check."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Protocol

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.units import DT, TOLERANCE, BoolArray, FloatArray, IntArray
from merge_cosim.ramps.ramp import Ramp, Way
from merge_cosim.sumo.lane_map import AlongPaths, LaneMap, LanePosition
from merge_cosim.sumo.options import SumoOptions
from merge_cosim.sumo.session import Car, Session
from merge_cosim.sumo.start import LibsumoSession
from merge_cosim.sumo.tiles import tile_id, tile_net

COLORS = ((40, 160, 60, 255), (210, 50, 40, 255))
"""Host and merging car, as in the papers' figures (RGBA)."""


class World(Protocol):
    """Moves one host and one merging car in each of `count` tiles.

    Attributes:
        count: Number of tiles.
        state: Stations of hosts and merging cars [m], then their speeds [m/s], shape (4, count).
        collided: Tiles in which SUMO has reported a contact since the encounter there was placed, shape (count,).
        step_s: Time [s] spent inside SUMO's steps so far; commanding and reading the cars is not in it.
    """

    count: int
    step_s: float
    state: FloatArray
    collided: BoolArray

    def place(self, tiles: IntArray, encounters: Encounters, cases: IntArray) -> None:
        """Put the encounters `cases` at their initial states into `tiles`."""

    def advance(self, speeds: FloatArray) -> None:
        """Drive all cars one cycle with the given speeds [m/s] of hosts and merging cars, shape (2, count)."""


class ClosedFormWorld:
    """The closed form: `s' = s + v dt` with the commanded speed."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.step_s = 0.0
        self.state = np.zeros((4, count))
        self.collided = np.zeros(count, dtype=bool)

    def place(self, tiles: IntArray, encounters: Encounters, cases: IntArray) -> None:
        """See `World`."""
        self.state[:, tiles] = encounters.start[:4, cases]

    def advance(self, speeds: FloatArray) -> None:
        """See `World`."""
        self.state[2:] = speeds
        self.state[:2] += speeds * DT


class TiledWorld:
    """SUMO drives the cars on disconnected copies of a ramp; they are added once and moved to each next start.

    Stations come from SUMO's lane positions, which depend on a car's own start and speeds alone; the odometer would
    carry the rounding of all earlier encounters in its tile. Speeds are the way of a step over its time, which is what
    SUMO reports (a test holds the two together), at half the calls.
    """

    def __init__(
        self,
        ramp: Ramp,
        count: int,
        seed: int = 0,
        open_session: Callable[[SumoOptions], Session] = LibsumoSession,
        extra: tuple[str, ...] = (),
        tiled: bool = True,
    ) -> None:
        """Open a session and add the cars.

        Args:
            ramp: The ramp.
            count: Number of tiles.
            seed: SUMO's seed.
            open_session: What opens SUMO.
            extra: Further options of SUMO.
            tiled: The session's net has tiles, not the ramp's own edges, which hold one encounter at a time.
        """
        self.ramp = ramp
        self.count = count
        self.step_s = 0.0
        self._id = tile_id if tiled else _own_id
        net = tile_net(ramp, count) if tiled else ramp.net
        self.session = open_session(SumoOptions(net, seed=seed, extra=extra))
        self._names = [self._id(tile, car) for car in ("host", "merging") for tile in range(count)]
        self._row = {name: row for row, name in enumerate(self._names)}
        routes = (ramp.main_route, ramp.ramp_route)
        self.session.add(
            Car(name, tuple(self._id(row % count, edge) for edge in routes[row // count]), COLORS[row // count])
            for name, row in self._row.items()
        )
        self._lanes, self._along = LaneMap(ramp), AlongPaths(ramp, count)
        self._merge_position = np.zeros(2 * count)
        self._length = np.full(2 * count, np.nan)
        self._in_host_lane = np.ones(count, dtype=bool)
        self.state = np.zeros((4, count))
        self.collided = np.zeros(count, dtype=bool)

    def place(self, tiles: IntArray, encounters: Encounters, cases: IntArray) -> None:
        """See `World`."""
        start = encounters.start[:, cases]
        self.state[:, tiles] = start[:4]
        self.collided[tiles] = False
        self._in_host_lane[tiles] = not self.ramp.changes_lane
        merge_position = encounters.merge_position[cases]
        paths: tuple[tuple[Way, IntArray], ...] = (("main", tiles), ("ramp", tiles + self.count))
        for car, (path, rows) in enumerate(paths):
            self._merge_position[rows] = merge_position
            values = zip(rows.tolist(), merge_position.tolist(), *start[car::2].tolist(), strict=True)
            for row, position, station, speed, length in values:
                self._place(row, self._lanes.place(path, station, position), speed, length)

    def _place(self, row: int, where: LanePosition, speed: float, length: float) -> None:
        name = self._names[row]
        self.session.place(name, self._id(row % self.count, f"{where.edge}_{where.lane}"), where.position, speed)
        self._along.put(row, where)
        if self._length[row] != length:
            self.session.set_length(name, length)
            self._length[row] = length

    def advance(self, speeds: FloatArray) -> None:
        """See `World`; a merging car whose front reaches the merging point in this cycle changes lane in it."""
        if self.ramp.changes_lane:
            self._change_lanes(self.state[1] + speeds[1] * DT)
        self.session.command(self._names, speeds.ravel().tolist())
        begin = perf_counter()
        self.session.step()
        self.step_s += perf_counter() - begin
        self._read()

    def _change_lanes(self, reached: FloatArray) -> None:
        """Command the lane changes of this cycle; `reached` are the merging cars' stations at its end [m]."""
        arrives = ~self._in_host_lane & (reached >= -TOLERANCE)
        for tile in np.flatnonzero(arrives).tolist():
            edge = self._lanes.place("main", max(float(reached[tile]), 0.0), float(self._merge_position[tile])).edge
            self.session.change_lane(self._names[tile + self.count], self._lanes.host_lane(edge))
        self._in_host_lane |= arrives

    def _read(self) -> None:
        position = np.fromiter(self.session.positions(self._names), np.float64, 2 * self.count)
        station = (self._along.x(position) - self._merge_position).reshape(2, self.count)
        np.subtract(station, self.state[:2], out=self.state[2:])
        self.state[2:] /= DT
        self.state[:2] = station
        for name in self._row.keys() & self.session.colliding():
            self.collided[self._row[name] % self.count] = True

    def close(self) -> None:
        """End the simulation."""
        self.session.close()


def _own_id(_tile: int, name: str) -> str:
    return name

"""The world of the pair tests: SUMO moves the cars on disconnected copies ("tiles") of a ramp."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import DECIMALS, Setting
from merge_cosim.core.units import DT, TOLERANCE, FloatArray, IntArray
from merge_cosim.ramps.ramp import Ramp, Way
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.leader import LeaderRule
from merge_cosim.simulation.worlds.base import Begun, Ended, GivenWorld
from merge_cosim.sumo.lane_map import AlongPaths, LaneMap, LanePosition, Part
from merge_cosim.sumo.options import SumoOptions
from merge_cosim.sumo.session import Car, Errors, Session
from merge_cosim.sumo.start import LibsumoSession, one_line
from merge_cosim.sumo.tiles import tile_id, tile_net
from merge_cosim.sumo.vehicle_types import RGBA

COLORS = (RGBA["host"], RGBA["merging"])


class TiledWorld(GivenWorld):
    """SUMO drives the cars on disconnected copies of a ramp; they are added once and moved to each next start.

    Stations come from SUMO's lane positions, which depend only on a car's own start and speeds; the odometer would
    carry the rounding of all earlier encounters in its tile. Speeds are the way of a step over its time, which is what
    SUMO reports (a test compares the two), at half the calls. The closed form of the same commands runs beside it.
    """

    def __init__(
        self,
        ramp: Ramp,
        slots: int,
        seed: int = 0,
        open_session: Callable[[SumoOptions], Session] = LibsumoSession,
        extra: tuple[str, ...] = (),
        tiled: bool = True,
        host: Way = "main",
    ) -> None:
        """Open a session and add the cars.

        Args:
            ramp: The ramp.
            slots: Number of tiles.
            seed: SUMO's seed.
            open_session: What opens SUMO.
            extra: Further options of SUMO.
            tiled: The session's net has tiles, not the ramp's own edges, which hold one encounter at a time.
            host: Where the hosts drive; the merging cars drive on the other path.

        Raises:
            UserError: SUMO does not start, or cannot drive on a path.
        """
        super().__init__(slots)
        self.ramp = ramp
        self.step_s = 0.0
        self._id = tile_id if tiled else _own_id
        net = tile_net(ramp, slots) if tiled else ramp.net
        self.session = open_session(SumoOptions(net, seed=seed, extra=extra))
        digits = len(str(slots - 1))
        # SUMO looks a car up in a tree of names, which is faster where the names sort as the rows do
        self._names = [
            f"{car}.{tile:0{digits}}" if slots > 1 else self._id(tile, car)
            for car in ("host", "merging")
            for tile in range(slots)
        ]
        self._row = {name: row for row, name in enumerate(self._names)}
        self._paths: tuple[Way, Way] = ("main", "ramp") if host == "main" else ("ramp", "main")
        self._by_ramp = self._paths.index("ramp")
        routes = [ramp.route(path) for path in self._paths]
        cars = (
            Car(name, tuple(self._id(row % slots, edge) for edge in routes[row // slots]), COLORS[row // slots])
            for name, row in self._row.items()
        )
        refusals: Errors = (*self.session.errors, RuntimeError)
        try:
            self.session.add(cars)
        except refusals as error:
            check = f"see what 'merge-cosim ramp check {ramp.net.parent}' says"
            raise UserError(f"{ramp.net}: SUMO cannot drive the ramp's paths: {one_line(error)}; {check}") from None
        self._lanes, self._along = LaneMap(ramp), AlongPaths(ramp, slots, self._paths)
        self._prefixes = [self._id(tile, "") for tile in range(slots)]
        self._driven = self._names
        """Names of the cars that are commanded and read."""
        self._rows: IntArray | None = None
        """Their rows; None for all."""
        self._merge_position = np.zeros(slots)
        self._length = np.full((2, slots), np.nan)
        self._changes_at = np.full(slots, np.inf)
        """Station at which each car from the ramp changes lane [m]; inf once it has."""
        self.state = np.zeros((4, slots))
        self._closed_form = np.zeros((2, slots))

    def start(
        self, encounters: Encounters | None, setting: Setting, rules: Rules, leader: LeaderRule, seed: int
    ) -> None:
        """See `World`; looks up where the cars start, as many share a place."""
        super().start(encounters, setting, rules, leader, seed)
        where: list[list[LanePosition]] = []
        for path, station in zip(self._paths, self.encounters.start, strict=False):
            places = [*zip(station.tolist(), self.encounters.merge_position.tolist(), strict=True)]
            known = {place: self._lanes.place(path, *place) for place in set(places)}
            where.append([known[place] for place in places])
        self._start_lanes = [[f"{one.edge}_{one.lane}" for one in each] for each in where]
        self._start_positions = np.array([[one.position for one in each] for each in where])
        self._start_edges = np.array([self._along.numbers(path, each) for path, each in enumerate(where)])

    def restart(self) -> None:
        """See `GivenWorld`."""
        super().restart()
        self._driven, self._rows = self._names, None

    def begin(self) -> Begun | None:
        """See `World`; once nothing is left to begin, the cars of free tiles stand, neither commanded nor read."""
        begun = super().begin()
        if begun is not None:
            self._driven, self._rows = self._names, None
        if len(self._free) and not len(self._queue):
            self._park()
        return begun

    def place(self, slots: IntArray, cases: IntArray) -> FloatArray:
        """See `GivenWorld`."""
        start = self.encounters.start.take(cases, axis=1)
        self.state[:, slots] = start[:4]
        self._closed_form[:, slots] = start[:2]
        self._changes_at[slots] = -TOLERANCE
        self._merge_position[slots] = self.encounters.merge_position[cases]
        rows = np.concatenate([slots, slots + self.slots])
        tiles, numbers = slots.tolist(), cases.tolist()
        names = [self._names[row] for row in rows.tolist()]
        lanes = [
            self._prefixes[tile] + starts[number]
            for starts in self._start_lanes
            for tile, number in zip(tiles, numbers, strict=True)
        ]
        positions = self._start_positions.take(cases, axis=1).ravel()
        self._along.put(rows, self._start_edges.take(cases, axis=1).ravel(), positions)
        begin = perf_counter()
        self.session.place_all(names, lanes, positions.tolist(), start[2:4].ravel().tolist())
        self.calls_s += perf_counter() - begin
        length = start[4:]
        differs = self._length.take(slots, axis=1) != length
        if np.count_nonzero(differs):
            for other in np.flatnonzero(differs).tolist():
                self.session.set_length(names[other], float(length.flat[other]))
            self._length[:, slots] = length
        return np.empty((0, len(slots)))

    def command(self, speeds: FloatArray) -> None:
        """See `World`; a car from the ramp whose front reaches the merging point in this cycle changes lane in it."""
        way = speeds * DT
        if self.ramp.changes_lane:
            self._change_lanes(self.state[self._by_ramp] + way[self._by_ramp])
        self._closed_form += way
        speeds = speeds.ravel()
        driven = speeds if self._rows is None else speeds[self._rows]
        begin = perf_counter()
        self.session.command(self._driven, driven)
        self.calls_s += perf_counter() - begin

    def step(self) -> None:
        """See `World`."""
        begin = perf_counter()
        self.session.step()
        self.step_s += perf_counter() - begin
        self._read()

    def observe(self, state: FloatArray, around: FloatArray) -> None:
        """See `World`."""
        self.state.round(DECIMALS, out=state)

    def ended(self, over: IntArray, age: IntArray) -> Ended | None:
        """See `World`; the stations are compared with the closed form's, in which a difference would have added up."""
        if len(over):
            apart = np.abs(self.state[:2].take(over, axis=1) - self._closed_form.take(over, axis=1))
            largest = float(apart.max())
            self.worst_difference_m = max(self.worst_difference_m, largest)
            if not largest <= TOLERANCE:
                self.breaks("closed_form", over[~(apart <= TOLERANCE).all(axis=0)])
            self._check_lanes(over)
        return super().ended(over, age)

    def show(self, log_odds: FloatArray) -> None:
        """See `World`."""
        for name, odds in zip(self._names, log_odds.tolist(), strict=False):
            self.session.show(name, odds)

    def close(self) -> None:
        """See `World`."""
        self.session.close()

    def _gone(self) -> UserError:
        """A car is in the net no longer, though its encounter is not over."""
        row = [name in self.session.vehicles() for name in self._names].index(False)
        car, case = ("host", "merging car")[row // self.slots], self.encounters.case[self._case[row % self.slots]]
        return UserError(
            f"{self.ramp.net}: case {case}: the {car} has left the net, which ends {self.ramp.downstream:.0f} m past "
            f"the gore, before the case was over; make the last edge longer, or lower test.horizon or test.time_out"
        )

    def _check_lanes(self, slots: IntArray) -> None:
        """Note the encounters with a car on a lane that is not its own."""
        by_main, by_ramp = (1 - self._by_ramp) * self.slots, self._by_ramp * self.slots
        past = self.state[self._by_ramp, slots]  # of the place where the merging car comes onto the host's lane
        if not self.ramp.changes_lane:
            past = past + self._merge_position[slots]
        rows = [*(slots + by_main).tolist(), *(slots + by_ramp).tolist()]
        lanes = [self._lanes[self.session.lane(self._names[row])] for row in rows]
        parts = [lane.part if lane else None for lane in lanes]
        for slot, way, main, ramp in zip(slots.tolist(), past.tolist(), parts, parts[len(slots) :], strict=False):
            due = Part.HOST if way > 0.0 else Part.MERGING
            if not (main is Part.HOST and (abs(way) <= TOLERANCE or ramp is due)):
                self.breaks("lane", np.array([slot]))

    def _change_lanes(self, reached: FloatArray) -> None:
        """Command the lane changes of this cycle; `reached`: stations of the cars from the ramp at its end [m]."""
        arrives = (reached >= self._changes_at).nonzero()[0]
        for tile in arrives.tolist():
            edge = self._lanes.place("main", max(float(reached[tile]), 0.0), float(self._merge_position[tile])).edge
            name = self._names[tile + self._by_ramp * self.slots]
            # Where a car enters another edge, SUMO adds to the commanded lane what the car's own number grows by.
            grows = self._lanes.merging_lane(edge) - int(self.session.lane(name).rpartition("_")[2])
            self.session.change_lane(name, self._lanes.host_lane(edge) - grows)
        self._changes_at[arrives] = np.inf

    def _park(self) -> None:
        """Let the cars of tiles that have become free stand."""
        idle = [*self._free.tolist(), *(self._free + self.slots).tolist()]
        self._rows = np.flatnonzero(np.tile(self._case >= 0, 2))
        self.session.command([self._names[row] for row in idle], np.zeros(len(idle)))
        self._driven = [self._names[row] for row in self._rows.tolist()]

    def _read(self) -> None:
        begin = perf_counter()
        try:
            position = self.session.positions(self._driven)
        except self.session.errors:
            raise self._gone() from None
        self.calls_s += perf_counter() - begin
        station = self._along.x(position, self._rows).reshape(2, self.slots) - self._merge_position
        before, speed = self.state[:2], self.state[2:]
        np.subtract(station, before, out=speed)
        speed /= DT
        before[:] = station
        if colliding := self.session.colliding():
            for name in self._row.keys() & colliding:
                self.collided[self._row[name] % self.slots] = True


def _own_id(_tile: int, name: str) -> str:
    return name

"""All cars of a logged scene in a running SUMO: each drives its log until a method or SUMO takes it over."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from merge_cosim.core.colors import OTHER, RELEASED, rgba
from merge_cosim.core.units import DT, BoolArray, FloatArray, IntArray
from merge_cosim.ngsim.pairing.recordings import LoggedScene
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.worlds.nearness import Places, in_conflict, near
from merge_cosim.sumo.logged_road import LoggedRoad, Strip
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.vehicle_types import LOGGED_TYPE, ReleasedDrivers

_COLORS = {"logged": rgba(OTHER), "released": rgba(RELEASED)}


class LoggedTraffic:
    """Drives the cars of a scene, once per cycle before SUMO's step.

    After `advance(k)` and a step, SUMO shows cycle k: every driven car has the x and the lane of its log. A car comes
    in where its log starts and is taken out when the log ends. SUMO must run with steps of 0.1 s, without internal
    links (x is a sum of edges' lengths), without action on collisions (`collision.action` none or warn), and
    with the type that `ReleasedDrivers` writes.

    Attributes:
        released: Names of the cars that were handed to SUMO, in that order.
        taken: Names of the cars that a method or the replay drives.
        blocked: Names of the cars that did not enter: a car off its log was too close, or an earlier
            part of the same car's track is in the net.
    """

    def __init__(
        self, session: Session, scene: LoggedScene, ramp: Ramp, drivers: ReleasedDrivers | None = None
    ) -> None:
        """Prepare a scene.

        Args:
            session: A running SUMO with the ramp's net.
            scene: The cars.
            ramp: The ramp of the scene's site.
            drivers: The driver model of released cars, as in the file that SUMO has loaded; None for the defaults.

        Raises:
            UserError: A log leads off the net.
        """
        self._session, self._scene, self._drivers = session, scene, drivers or ReleasedDrivers()
        self._road = logged_road(ramp)
        self._strip = self._road.find(scene.lane, scene.x)
        self._way = _ways(scene)
        self._names: list[str] = scene.car.tolist()
        self._last = scene.last
        self._cycle: int | None = None
        self._driven: IntArray = np.empty(0, dtype=np.int64)
        self._off_log: list[int] = []
        self.released: list[str] = []
        self.taken: list[str] = []
        self.blocked: list[str] = []

    @property
    def driven(self) -> list[str]:
        """Names of the cars in the net that drive their log."""
        return [self._names[car] for car in self._driven]

    def advance(self, cycle: int) -> None:
        """Command the step that leads to `cycle`; the first call may name any, the others follow one by one."""
        if self._cycle is not None and cycle != self._cycle + 1:
            raise ValueError(f"cycle {cycle} does not follow {self._cycle}")
        scene, session = self._scene, self._session
        for car in self._driven[self._last[self._driven] < cycle]:
            session.remove(self._names[car])
        going = self._driven[self._last[self._driven] >= cycle]
        row = scene.row(going, cycle)
        for car, value in zip(going.tolist(), (self._way[row] / DT).tolist(), strict=True):
            session.set_speed(self._names[car], value)
        changing = np.flatnonzero(scene.lane[row] != scene.lane[row - 1])
        for car, at in zip(going[changing].tolist(), row[changing].tolist(), strict=True):
            self._change_lane(car, at)
        coming = scene.present(cycle) if self._cycle is None else np.flatnonzero(scene.enters == cycle)
        self._driven = np.append(going, self._admitted(coming, cycle))
        for car in self._driven[len(going) :].tolist():
            self._enter(car, int(scene.row(car, cycle)))
        self._cycle = cycle

    def take_over(self, car: str) -> None:
        """Stop driving a car by its log; its last command stays in force until the next.

        Raises:
            ValueError: It is not in the net on its log.
        """
        self._let_go(car)
        self.taken.append(car)

    def release(self, car: str) -> None:
        """Hand a car to SUMO's models, on the route of its log.

        Raises:
            ValueError: It is not in the net on its log.
        """
        self._let_go(car)
        self._session.release(car)
        self._session.set_color(car, _COLORS["released"])
        self.released.append(car)

    def release_near(
        self, host: str, ahead: float = 30.0, behind: float = 60.0, keep: Collection[str] = ()
    ) -> list[str]:
        """Release the cars that come near a taken host, and those that would drive into any car that is off its log.

        To be called between a step and the next `advance`. The first are the cars in the host's lane and the lanes
        beside it; the second are cars anywhere that `in_conflict` finds, now or by the next cycle of their log.

        Args:
            host: A car that was taken over.
            ahead: Reach ahead of the host, front to front [m].
            behind: Reach behind it [m].
            keep: Names of cars that keep to their logs whatever happens, such as the merging car.

        Returns:
            Names of the cars that were released now.
        """
        assert self._cycle is not None
        candidates = self._driven[[self._names[car] not in keep for car in self._driven]]
        cars, free = self._free_places()
        found = np.zeros(len(candidates), dtype=bool)
        for ahead_by in (0, 1):
            logged = self._logged_places(candidates, self._cycle + ahead_by)
            free = replace(free, x=free.x + ahead_by * DT * free.speed)
            found |= self._conflicts(logged, free).any(axis=1)
            for at in (k for k, car in enumerate(cars) if self._names[car] == host):
                found |= near(logged, int(free.lane[at]), float(free.x[at]), ahead, behind)
        names = [self._names[car] for car in candidates[found]]
        for name in names:
            self.release(name)
        return names

    def _admitted(self, coming: IntArray, cycle: int) -> IntArray:
        """Of the cars whose log starts, those that have room, and are not in the net already in another part."""
        if not self._off_log or not len(coming):
            return coming
        places, free = self._logged_places(coming, cycle), self._free_places()[1]
        refused = self._conflicts(places, free).any(axis=1) | self._conflicts(free, places).any(axis=0)
        refused |= np.isin(self._scene.vehicle[coming], self._scene.vehicle[self._off_log])
        self.blocked += [self._names[car] for car in coming[refused]]
        return coming[~refused]

    def _conflicts(self, cars: Places, others: Places) -> BoolArray:
        return in_conflict(cars, others, self._drivers.min_gap, self._drivers.decel)

    def _let_go(self, name: str) -> None:
        car = self._scene.index(name)
        if car not in self._driven:
            raise ValueError(f"car {name} is not in the net on its log in cycle {self._cycle}")
        self._driven = self._driven[self._driven != car]
        self._off_log.append(car)

    def _enter(self, car: int, row: int) -> None:
        """Put a car where the step that leads to a row starts, in the row's lane."""
        scene, session, name = self._scene, self._session, self._names[car]
        x = scene.x[row] - self._way[row]
        strip = self._strip_at(int(scene.lane[row]), x)
        speed = float(self._way[row] / DT)
        session.insert(name, self._route(car, row, strip), LOGGED_TYPE)
        session.set_length(name, float(scene.length[car]))
        session.set_color(name, _COLORS["logged"])
        session.place(name, strip.id, float(x - strip.start), speed)
        session.set_speed(name, speed)

    def _change_lane(self, car: int, row: int) -> None:
        """Bring a car into the lane of a row within the step that leads to it.

        SUMO changes by one lane and within one edge. Any other change in a log is a jump onto the other lane before the
        step; across the gore, where no route leads, the car leaves the net and comes in again in the same step.
        """
        name, strips = self._names[car], self._road.strips
        before, after = strips[self._strip[row - 1]], strips[self._strip[row]]
        if before.edge == after.edge and abs(before.lane_index - after.lane_index) == 1:
            self._session.change_lane(name, after.lane_index)
            return
        x = self._scene.x[row - 1]
        strip = self._strip_at(int(self._scene.lane[row]), x)
        if strip.edge in self._session.route(name):
            self._session.place(name, strip.id, float(x - strip.start))
        else:
            self._session.remove(name)
            self._enter(car, row)

    def _strip_at(self, lane: int, x: float) -> Strip:
        return self._road.strips[self._road.find(np.array([lane]), np.array([x]))[0]]

    def _route(self, car: int, row: int, first: Strip) -> tuple[str, ...]:
        """Edges of a car's log from a row to its end, or to a jump across the gore, and from there on."""
        strips = [first]
        for number in self._strip[row : self._scene.offsets[car + 1]]:
            strip = self._road.strips[number]
            if not self._road.drivable(strips[-1], strip):
                break
            strips.append(strip)
        from_ramp = self._scene.lane[self._scene.offsets[car]] == self._road.side_lane
        return (*dict.fromkeys(strip.edge for strip in strips), *self._road.onward(strips[-1], bool(from_ramp)))

    def _logged_places(self, cars: IntArray, cycle: int) -> Places:
        """Where the logs have cars in a cycle, or in their last one."""
        scene = self._scene
        row = scene.row(cars, np.minimum(cycle, self._last[cars]))
        return Places(scene.lane[row], scene.x[row], scene.length[cars], self._way[row] / DT)

    def _free_places(self) -> tuple[list[int], Places]:
        """The cars in the net that are off their logs, and where SUMO has them."""
        session, present = self._session, set(self._session.vehicles())
        cars: list[int] = []
        places: list[tuple[float, ...]] = []
        for car in self._off_log:
            name = self._names[car]
            strip = self._road.at(session.lane(name)) if name in present else None
            if strip is not None:
                x = strip.start + session.lane_position(name)
                cars.append(car)
                places.append((strip.lane, x, self._scene.length[car], session.speed(name)))
        lane, *state = np.array(places).reshape(-1, 4).T
        return cars, Places(lane.astype(np.int64), *state)


def logged_road(ramp: Ramp) -> LoggedRoad:
    """Where the lanes of the recording at a ramp lie in its net.

    Raises:
        UserError: Nothing was recorded at the ramp, or its file does not say where the lanes lie.
    """
    site = find_site(ramp.net.parent)
    return LoggedRoad(ramp, site.ramp_lanes, site.exit_lanes, site.host_lane)


def _ways(scene: LoggedScene) -> FloatArray:
    """Distance driven in the step to each row [m], shape (rows,); a car's first row has that of its next one."""
    way = np.diff(scene.x, prepend=0.0)
    first, several = scene.offsets[:-1], np.diff(scene.offsets) > 1
    way[first[several]] = way[first[several] + 1]
    way[first[~several]] = 0.0
    return way

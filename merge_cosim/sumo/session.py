"""A running SUMO: the same calls by libsumo in this process or by TraCI to another process."""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from merge_cosim.core.colors import FOLLOWS, Rgba, rgba
from merge_cosim.core.units import FloatArray
from merge_cosim.sumo.modes import LaneChangeMode, SpeedMode
from merge_cosim.sumo.vehicle_types import CONTROLLED, RGBA

SPEED_OF_SUMO = -1.0
"""The commanded speed that gives a vehicle back to its car-following model."""
_SETTERS = {"minGap": "setMinGap", "sigma": "setImperfection", "speedDev": "setSpeedDeviation"}
"""By the attributes of a type, what sets them in a running SUMO."""
_VIEW, _ZOOM = "View #0", 1500.0

Errors = tuple[type[Exception], ...]


@dataclass(frozen=True)
class Car:
    """A car that drives exactly as commanded.

    Attributes:
        name: SUMO's vehicle id.
        route: Edge ids.
        color: RGBA.
    """

    name: str
    route: tuple[str, ...]
    color: Rgba


class Neighbour(NamedTuple):
    """A vehicle ahead or behind in the lane; without one the name is empty and the gap inf.

    Attributes:
        name: SUMO's vehicle id.
        gap: Gap from bumper to bumper [m]. SUMO itself takes off the minimum gap of the vehicle behind.
    """

    name: str
    gap: float


class Contact(NamedTuple):
    """A contact of two vehicles that SUMO reports, in the order of their ids, and the lane where it is."""

    one: str
    other: str
    lane: str


class Session:
    """A running SUMO. Vehicles, lanes, edges and types are named by SUMO's ids; speeds are in m/s, lengths in m.

    Attributes:
        step: Simulate one step.
        set_speed: Command a vehicle's speed of the next steps.
        lane: Lane that a vehicle is on; empty off the net.
        lane_position: Position of a vehicle's front bumper on its lane.
        speed: Speed of a vehicle.
        edge, route, kind, length, min_gap: Edge, route, type, length and minimum gap of a vehicle.
        set_length, set_color: Change a vehicle.
        remove: Take a vehicle out.
        vehicles, vehicle_count: Vehicles in the net, and their number.
        departed, arrived, arrived_count: Vehicles that came in or left in the last step.
        teleporting: Vehicles that began to teleport in it.
        pending: Vehicles that wait outside for room.
        expected_count: Vehicles in the net or still to come.
        lanes, lane_length: All lanes of the net, and the length of one.
        time: Time of the simulation [s].
        close: End the simulation, or the connection.
    """

    def __init__(self, api: Any, errors: Errors = ()) -> None:
        """Use a running simulation.

        Args:
            api: The module libsumo or traci, or a connection of traci.
            errors: What it raises where SUMO refuses something or has ended.
        """
        vehicle, simulation = api.vehicle, api.simulation
        self._api = api
        self._routes: dict[tuple[str, ...], str] = {}
        self.errors = errors
        self.step: Callable[[], object] = api.simulationStep
        self.close: Callable[[], object] = api.close
        self.set_speed: Callable[[str, float], object] = vehicle.setSpeed
        self.lane: Callable[[str], str] = vehicle.getLaneID
        self.lane_position: Callable[[str], float] = vehicle.getLanePosition
        self.speed: Callable[[str], float] = vehicle.getSpeed
        self._move_to: Callable[[str, str, float], object] = vehicle.moveTo
        self._set_previous_speed: Callable[[str, float], object] = vehicle.setPreviousSpeed
        self._colliding_number: Callable[[], int] = simulation.getCollidingVehiclesNumber
        if getattr(api, "__name__", "") == "libsumo":
            from libsumo import _libsumo as raw  # the raw calls spare a Python frame each

            self.set_speed, self.lane_position = raw.vehicle_setSpeed, raw.vehicle_getLanePosition
            self.lane, self.speed = raw.vehicle_getLaneID, raw.vehicle_getSpeed
            self._move_to, self._set_previous_speed = raw.vehicle_moveTo, raw.vehicle_setPreviousSpeed
            self._colliding_number = raw.simulation_getCollidingVehiclesNumber
        self.edge: Callable[[str], str] = vehicle.getRoadID
        self.route: Callable[[str], tuple[str, ...]] = vehicle.getRoute
        self.kind: Callable[[str], str] = vehicle.getTypeID
        self.length: Callable[[str], float] = vehicle.getLength
        self.min_gap: Callable[[str], float] = vehicle.getMinGap
        self.set_length: Callable[[str, float], object] = vehicle.setLength
        self.set_color: Callable[[str, Rgba], object] = vehicle.setColor
        self.remove: Callable[[str], object] = vehicle.remove
        self.vehicles: Callable[[], Sequence[str]] = vehicle.getIDList
        self.vehicle_count: Callable[[], int] = vehicle.getIDCount
        self.departed: Callable[[], Sequence[str]] = simulation.getDepartedIDList
        self.arrived: Callable[[], Sequence[str]] = simulation.getArrivedIDList
        self.arrived_count: Callable[[], int] = simulation.getArrivedNumber
        self.teleporting: Callable[[], Sequence[str]] = simulation.getStartingTeleportIDList
        self.pending: Callable[[], Sequence[str]] = simulation.getPendingVehicles
        self.expected_count: Callable[[], int] = simulation.getMinExpectedNumber
        self.lanes: Callable[[], Sequence[str]] = api.lane.getIDList
        self.lane_length: Callable[[str], float] = api.lane.getLength
        self.time: Callable[[], float] = simulation.getTime

    def command(self, cars: Sequence[str], speeds: FloatArray) -> None:
        """Set the speeds of the next step of many vehicles [m/s], shape (cars,)."""
        deque(map(self.set_speed, cars, speeds.data), maxlen=0)

    def positions(self, cars: Sequence[str]) -> FloatArray:
        """Positions of the front bumpers of many vehicles on their present lanes [m], shape (cars,)."""
        found = np.empty(len(cars))
        struct.pack_into(f"{len(cars)}d", found.data, 0, *map(self.lane_position, cars))  # faster than np.fromiter
        return found

    def colliding(self) -> Sequence[str]:
        """Vehicles in a contact that SUMO reports for the last step; the number is asked first, as it is cheaper."""
        found: Sequence[str] = self._api.simulation.getCollidingVehiclesIDList() if self._colliding_number() else ()
        return found

    def add(self, cars: Iterable[Car]) -> None:
        """Put in cars of one type that drive exactly as commanded; they stand until they are placed.

        Raises:
            RuntimeError: SUMO did not insert them.
        """
        types, kind = self._api.vehicletype, CONTROLLED.id
        types.copy("DEFAULT_VEHTYPE", kind)
        for name, value in CONTROLLED.attributes.items():
            getattr(types, _SETTERS[name])(kind, value)
        cars = list(cars)
        for car in cars:
            self.insert(car.name, car.route, kind, departLane="free", departSpeed="0")
            self.set_color(car.name, car.color)
            self.set_speed(car.name, 0.0)
        self.step()
        missing = {car.name for car in cars} - set(self.vehicles())
        if missing:
            raise RuntimeError(f"SUMO did not insert {sorted(missing)[:3]} ({len(missing)} of {len(cars)} cars)")

    def insert(self, car: str, route: tuple[str, ...], kind: str, **departure: str) -> None:
        """Let a car of a type come in with the next step, or be placed before it; it drives exactly as commanded.

        Args:
            car: Its id.
            route: Edge ids.
            kind: Its type.
            departure: Where and how it departs, by SUMO's names (`departLane`, ...).
        """
        if route not in self._routes:
            self._routes[route] = f"route.{car}"
            self._api.route.add(self._routes[route], route)
        self._api.vehicle.add(car, self._routes[route], typeID=kind, **departure)
        self.take_control(car)

    def take_control(self, car: str) -> None:
        """From now on a vehicle drives exactly as commanded, and changes lane only on command."""
        self._api.vehicle.setSpeedMode(car, SpeedMode.UNCHECKED)
        self._api.vehicle.setLaneChangeMode(car, LaneChangeMode.NONE)

    def release(self, car: str) -> None:
        """Give a vehicle back to SUMO's models."""
        self._api.vehicle.setSpeedMode(car, SpeedMode.SUMO)
        self._api.vehicle.setLaneChangeMode(car, LaneChangeMode.SUMO)
        self.set_speed(car, SPEED_OF_SUMO)

    def place(self, car: str, lane: str, position: float, speed: float | None = None) -> None:
        """Put a car's front bumper at `position` on a lane, as if it had come with `speed` (None: with its own)."""
        self._move_to(car, lane, position)
        if speed is not None:
            self._set_previous_speed(car, speed)

    def place_all(
        self, cars: Sequence[str], lanes: Sequence[str], positions: Sequence[float], speeds: Sequence[float]
    ) -> None:
        """Do the same for many cars."""
        deque(map(self._move_to, cars, lanes, positions), maxlen=0)
        deque(map(self._set_previous_speed, cars, speeds), maxlen=0)

    def change_lane(self, car: str, index: int) -> None:
        """Bring a car to the lane `index` of its edge within the next step."""
        self._api.vehicle.changeLane(car, index, 0.0)

    def stay_on(self, car: str, route: tuple[str, ...]) -> None:
        """Let a vehicle drive from its present edge along the rest of a route."""
        self._api.vehicle.setRoute(car, route[route.index(self.edge(car)) :])

    def leader(self, car: str, reach: float) -> Neighbour:
        """The vehicle ahead in a vehicle's lane, or at most `reach` away on the further lanes of its route."""
        name, gap = self._api.vehicle.getLeader(car, reach) or ("", 0.0)
        return Neighbour(name, gap + self.min_gap(car) if name else math.inf)

    def follower(self, car: str, reach: float) -> Neighbour:
        """The vehicle behind a vehicle in its lane, at most `reach` away."""
        name, gap = self._api.vehicle.getFollower(car, reach)
        return Neighbour(name, gap + self.min_gap(name) if name else math.inf)

    def follows_route(self, car: str, lane: str) -> bool:
        """Whether a lane of a vehicle's present edge leads to the next edge of its route, or the route ends there."""
        onward = self.route(car)[self._api.vehicle.getRouteIndex(car) + 1 :]
        return not onward or any(link[0].rpartition("_")[0] == onward[0] for link in self._api.lane.getLinks(lane))

    def parameter(self, car: str, key: str) -> str:
        """A vehicle's own parameter; empty without one."""
        return str(self._api.vehicle.getParameter(car, key))

    def kinds(self) -> Sequence[str]:
        """All types."""
        found: Sequence[str] = self._api.vehicletype.getIDList()
        return found

    def kind_parameter(self, kind: str, key: str) -> str:
        """A type's parameter; empty without one."""
        return str(self._api.vehicletype.getParameter(kind, key))

    def contacts(self) -> list[Contact]:
        """The contacts that SUMO reports for the last step."""
        if not self._colliding_number():
            return []
        found = self._api.simulation.getCollisions()
        return [Contact(min(c.collider, c.victim), max(c.collider, c.victim), c.lane) for c in found]

    def statistic(self, key: str) -> float:
        """One of SUMO's counts and means over the simulation so far, by SUMO's name (`stats.teleports.total`, ...)."""
        return float(self._api.simulation.getParameter("", key))

    def option(self, name: str) -> str:
        """The value of an option that SUMO was started with."""
        return str(self._api.simulation.getOption(name))

    def has_edge(self, edge: str) -> bool:
        """Whether the net has an edge."""
        return edge in self._api.edge.getIDList()

    def follow(self, car: str) -> None:
        """Let the view of sumo-gui follow a vehicle."""
        self._api.gui.trackVehicle(_VIEW, car)
        self._api.gui.setZoom(_VIEW, _ZOOM)

    def show(self, host: str, log_odds: float) -> None:
        """Show a host's belief and decision as parameters of the vehicle, and the decision as its colour."""
        follows = log_odds >= 0.0
        belief = f"{0.5 + 0.5 * math.tanh(0.5 * log_odds):.2f}"
        self.set_color(host, rgba(FOLLOWS) if follows else RGBA["host"])
        self._api.vehicle.setParameter(host, "P(merging car does not yield)", belief)
        self._api.vehicle.setParameter(host, "decision", "follows it" if follows else "goes first")

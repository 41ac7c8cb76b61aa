"""Ordinary SUMO route files as encounters: cars whose type carries the parameter `merge-cosim.role`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.configuration import Configuration, parse
from merge_cosim.sumo.lane_map import LaneMap, LanePosition
from merge_cosim.sumo.vehicle_types import MERGE_POSITION, ROLE

ROLES = ("host", "merging")
DEFAULT_LENGTH = 5.0
"""Length of SUMO's default passenger car [m]."""


@dataclass(frozen=True)
class _Car:
    name: str
    edge: str
    position: float
    speed: float
    length: float
    merge_position: float | None


def only_pairs(configuration: Configuration) -> bool:
    """Whether there is nothing but pairs of a host and a merging car: encounters, and no traffic.

    Both start from numbers, and at the same time.
    """
    entries = [entry for file in configuration.routes for entry in _entries(parse(file)) if entry.has_start]
    host, merging = ([one.vehicle.get("depart") for one in entries if one.role == role] for role in ROLES)
    everything = len(list(configuration.vehicles()))
    return 0 < everything == len(entries) and host == merging


def read_sumocfg(file: Path) -> tuple[Ramp, Encounters]:
    """Read the ramp and the encounters of a `.sumocfg`.

    Its net must be that of a ramp (`ramp.toml` lies beside it). The k-th car with the role `host` meets the k-th with
    the role `merging`, in the order of the route files; their start is given by departure edge, position and speed, as
    numbers. Other cars are passed over.

    Raises:
        UserError: A file is missing or no XML, or a car cannot be understood.
    """
    configuration = Configuration.read(file)
    ramp, routes = Ramp.load(configuration.net.parent), configuration.routes
    cars: dict[str, list[_Car]] = {role: [] for role in ROLES}
    for route_file in routes:
        for role, car in _cars(route_file):
            cars[role].append(car)
    hosts, merging = cars["host"], cars["merging"]
    if not hosts or len(hosts) != len(merging):
        raise UserError(
            f"{file}: {len(hosts)} cars with the role host and {len(merging)} with the role merging; each encounter "
            f'needs one of both (<param key="{ROLE}" value="host"/> in the vType)'
        )
    merge_position = np.array(
        [ramp.merging_point if car.merge_position is None else car.merge_position for car in merging]
    )
    return ramp, Encounters.unlogged(
        np.array([f"{host.name}_{car.name}" for host, car in zip(hosts, merging, strict=True)]),
        ramp.name,
        "designed",
        host_station=_stations(ramp, hosts, merge_position, routes[0]),
        host_speed=np.array([car.speed for car in hosts]),
        host_length=np.array([car.length for car in hosts]),
        merging_station=_stations(ramp, merging, merge_position, routes[0]),
        merging_speed=np.array([car.speed for car in merging]),
        merging_length=np.array([car.length for car in merging]),
        merge_position=merge_position,
    )


def _stations(ramp: Ramp, cars: list[_Car], merge_position: np.ndarray, file: Path) -> np.ndarray:
    lanes, stations = LaneMap(ramp), []
    for car, merging_point in zip(cars, merge_position, strict=True):
        try:
            stations.append(lanes.station(LanePosition(car.edge, 0, car.position), float(merging_point)))
        except ValueError as error:
            raise UserError(f"{file}: vehicle '{car.name}': {error}") from None
    return np.array(stations)


@dataclass(frozen=True)
class _Entry:
    """A `<vehicle>` with a role, its type, and the parameters of both."""

    vehicle: etree._Element
    kind: etree._Element
    role: str
    parameters: dict[str | None, str]

    @property
    def has_start(self) -> bool:
        """Its start is given in numbers."""
        return all(_is_number(self.vehicle.get(name)) for name in ("departPos", "departSpeed"))


def _entries(root: etree._Element) -> Iterator[_Entry]:
    types = {kind.get("id", ""): kind for kind in root.iter("vType")}
    for vehicle in root.iter("vehicle"):
        kind = types.get(vehicle.get("type", ""))
        parameters = {one.get("key"): one.get("value", "") for one in ([] if kind is None else kind.iter("param"))}
        parameters |= {one.get("key"): one.get("value", "") for one in vehicle.iter("param")}
        role = parameters.get(ROLE)
        if kind is not None and role is not None:
            yield _Entry(vehicle, kind, role, parameters)


def _cars(file: Path) -> Iterator[tuple[str, _Car]]:
    root = parse(file)
    routes = {route.get("id"): route.get("edges", "") for route in root.iter("route")}
    for entry in _entries(root):
        vehicle, kind, role, parameters = entry.vehicle, entry.kind, entry.role, entry.parameters
        where = f"{file}:{vehicle.sourceline}: vehicle '{vehicle.get('id')}'"
        if role not in ROLES:
            raise UserError(f"{where}: {ROLE} is '{role}'; it must be {' or '.join(ROLES)}")
        inner = vehicle.find("route")
        edges = (inner.get("edges", "") if inner is not None else routes.get(vehicle.get("route"), "")).split()
        if not edges:
            raise UserError(f"{where}: it has no route")
        merge_position = parameters.get(MERGE_POSITION)
        yield (
            role,
            _Car(
                name=vehicle.get("id", ""),
                edge=edges[0],
                position=_number(vehicle.get("departPos"), "departPos", where),
                speed=_number(vehicle.get("departSpeed"), "departSpeed", where),
                length=_number(kind.get("length", str(DEFAULT_LENGTH)), "length", where),
                merge_position=None if merge_position is None else _number(merge_position, MERGE_POSITION, where),
            ),
        )


def _number(text: str | None, name: str, where: str) -> float:
    if not _is_number(text):
        raise UserError(f"{where}: {name} is '{text or ''}'; an encounter needs a number")
    return float(text or "")


def _is_number(text: str | None) -> bool:
    try:
        return math.isfinite(float(text or ""))
    except ValueError:
        return False

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
from merge_cosim.core.units import MOST_LENGTH, MOST_SPEED, TOLERANCE
from merge_cosim.ramps.ramp import Ramp, Way
from merge_cosim.sumo.configuration import DEFAULT_TYPE, Configuration, parse
from merge_cosim.sumo.lane_map import LaneMap, LanePosition
from merge_cosim.sumo.vehicle_types import MERGE_POSITION, ROLE

ROLES = ("host", "merging")
DEFAULT_LENGTH = 5.0
"""Length of SUMO's default passenger car [m]."""

_COMES: dict[Way, str] = {"main": "along the main road", "ramp": "over the on-ramp"}
_LANES = {"host": "host's lane", "merging": "merging car's lane"}
_NO_TYPE = etree.Element("vType")


@dataclass(frozen=True)
class _Car:
    name: str
    where: str
    route: tuple[str, ...]
    lane: str | None
    position: float
    speed: float
    length: float
    merge_position: float | None


def only_pairs(configuration: Configuration) -> bool:
    """Whether there are only pairs of a host and a merging car, and no other traffic.

    Both starts are given in numbers, for the same time.
    """
    entries = [entry for entry in _entries(configuration) if entry.has_start]
    host, merging = ([one.vehicle.get("depart") for one in entries if one.role == role] for role in ROLES)
    everything = len(list(configuration.vehicles()))
    return 0 < everything == len(entries) and host == merging


def read_sumocfg(file: Path, host: Way = "main") -> tuple[Ramp, Encounters]:
    """Read the ramp and the encounters of a `.sumocfg`.

    Its net must be that of a ramp (`ramp.toml` lies beside it). The k-th car with the role `host` meets the k-th with
    the role `merging`, in the order of the route files; their start is given by departure edge, position and speed, as
    numbers. A host's route leads along the main road, a merging car's over the on-ramp, or the other way round where
    `host` is `ramp`. Other cars are ignored.

    Raises:
        UserError: A file is missing or no XML, or a car cannot be understood or is routed elsewhere.
    """
    return read_pairs(Configuration.read(file), host)


def read_pairs(configuration: Configuration, host: Way = "main") -> tuple[Ramp, Encounters]:
    """The same as `read_sumocfg` for a configuration that has been read."""
    file = configuration.file
    ramp = Ramp.load(configuration.net.parent)
    cars: dict[str, list[_Car]] = {role: [] for role in ROLES}
    for entry in _entries(configuration):
        cars[entry.role].append(_car(entry))
    hosts, merging = cars["host"], cars["merging"]
    if not hosts or len(hosts) != len(merging):
        raise UserError(
            f"{file}: {len(hosts)} cars with the role host and {len(merging)} with the role merging; each encounter "
            f'needs one of both (<param key="{ROLE}" value="host"/> in the vType)'
        )
    merge_position = np.array(
        [ramp.merging_point if car.merge_position is None else car.merge_position for car in merging]
    )
    names = [f"{host.name}_{car.name}" for host, car in zip(hosts, merging, strict=True)]
    if twice := [name for name in names if names.count(name) > 1]:
        raise UserError(f"{file}: two encounters are called '{twice[0]}'; give each vehicle an id of its own")
    other: Way = "ramp" if host == "main" else "main"
    return ramp, Encounters.unlogged(
        np.array(names),
        ramp.name,
        "designed",
        host_station=_stations(ramp, "host", host, hosts, merge_position),
        host_speed=np.array([car.speed for car in hosts]),
        host_length=np.array([car.length for car in hosts]),
        merging_station=_stations(ramp, "merging", other, merging, merge_position),
        merging_speed=np.array([car.speed for car in merging]),
        merging_length=np.array([car.length for car in merging]),
        merge_position=merge_position,
    )


def _stations(ramp: Ramp, role: str, path: Way, cars: list[_Car], merge_position: np.ndarray) -> np.ndarray:
    """Stations of cars of one role at their start [m]."""
    lanes = LaneMap(ramp)
    found = [
        lanes.station(_start(ramp, role, path, car), float(at)) for car, at in zip(cars, merge_position, strict=True)
    ]
    return np.array(found)


def _start(ramp: Ramp, role: str, path: Way, car: _Car) -> LanePosition:
    """Where a car starts; its route is checked against its role."""
    edge, route = car.route[0], ramp.route(path)
    along = route[route.index(edge) :] if edge in route else ()
    if not along or any(mine != theirs for mine, theirs in zip(car.route, along, strict=False)):
        raise UserError(
            f"{car.where}: its route is '{' '.join(car.route)}'; a {role} car comes {_COMES[path]}: {' '.join(route)}"
        )
    sections = [one for one in (ramp.main if path == "main" else ramp.ramp + ramp.main) if one.edge == edge]
    lanes = {str(one.lane) for one in sections}
    if _is_number(car.lane) and car.lane not in lanes:
        raise UserError(
            f"{car.where}: departLane is {car.lane}; on '{edge}' the {_LANES[role]} is {' or '.join(sorted(lanes))}"
        )
    length = sections[0].length
    position = car.position + length if car.position < 0.0 else car.position  # SUMO counts from the end, too
    if not -TOLERANCE <= position <= length + TOLERANCE:
        raise UserError(f"{car.where}: departPos is {car.position:g}; '{edge}' is {length:g} m long")
    return LanePosition(edge, sections[0].lane, position)


@dataclass(frozen=True)
class _Entry:
    """A `<vehicle>` with a role.

    Attributes:
        vehicle: The element.
        where: File, line and id, for error lines.
        role: Its role.
        parameters: Those of its type and its own.
        length: Length of its type, as it is written.
        edges: Its route.
    """

    vehicle: etree._Element
    where: str
    role: str
    parameters: dict[str | None, str]
    length: str
    edges: str

    @property
    def has_start(self) -> bool:
        """Its start is given in numbers."""
        return all(_is_number(self.vehicle.get(name)) for name in ("departPos", "departSpeed"))


def _entries(configuration: Configuration) -> Iterator[_Entry]:
    """The vehicles with a role, in the order of the files; types and routes may stand in any of these."""
    roots = {file: parse(file) for file in (*configuration.routes, *configuration.additional)}
    types = {kind.get("id"): kind for root in roots.values() for kind in root.iter("vType")}
    routes = {one.get("id"): one.get("edges", "") for root in roots.values() for one in root.iter("route")}
    for file, root in roots.items():
        for vehicle in root.iter("vehicle"):
            kind = types.get(vehicle.get("type", DEFAULT_TYPE), _NO_TYPE)
            parameters = {
                one.get("key"): one.get("value", "") for part in (kind, vehicle) for one in part.iter("param")
            }
            role = parameters.get(ROLE)
            if role is None:
                continue
            where = f"{file}:{vehicle.sourceline}: vehicle '{vehicle.get('id')}'"
            if role not in ROLES:
                raise UserError(f"{where}: {ROLE} is '{role}'; it must be {' or '.join(ROLES)}")
            inner, named = vehicle.find("route"), vehicle.get("route")
            edges = inner.get("edges", "") if inner is not None else routes.get(named, "") if named else ""
            yield _Entry(vehicle, where, role, parameters, kind.get("length", str(DEFAULT_LENGTH)), edges)


def _car(entry: _Entry) -> _Car:
    vehicle, where = entry.vehicle, entry.where
    if not entry.edges.split():
        named = vehicle.get("route")
        why = f"no route with edges is called '{named}'" if named else 'it has no route; give it <route edges="..."/>'
        raise UserError(f"{where}: {why}")
    merge_position = entry.parameters.get(MERGE_POSITION)
    return _Car(
        name=vehicle.get("id", ""),
        where=where,
        route=tuple(entry.edges.split()),
        lane=vehicle.get("departLane"),
        position=_number(vehicle.get("departPos"), "departPos", where),
        speed=_number(vehicle.get("departSpeed"), "departSpeed", where, least=0.0, most=MOST_SPEED),
        length=_number(entry.length, "length", where, least=0.1, most=MOST_LENGTH),
        merge_position=None if merge_position is None else _number(merge_position, MERGE_POSITION, where),
    )


def _number(text: str | None, name: str, where: str, least: float = -math.inf, most: float = math.inf) -> float:
    if not _is_number(text):
        raise UserError(f"{where}: {name} is '{text or ''}'; an encounter needs a number")
    value = float(text or "")
    if value < least:
        raise UserError(f"{where}: {name} is {text}; it must be at least {least:g}")
    if value > most:
        raise UserError(f"{where}: {name} is {text}; it must be at most {most:g}")
    return value


def _is_number(text: str | None) -> bool:
    try:
        return math.isfinite(float(text or ""))
    except ValueError:
        return False

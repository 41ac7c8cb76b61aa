"""Who is in a scene: the hosts, and the cars that are yet to merge, as SUMO has them in every cycle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from merge_cosim.scoring.tracks import DECIMALS
from merge_cosim.sumo.lanes import Part, RampLane, RampLanes
from merge_cosim.sumo.routes import ROLE
from merge_cosim.sumo.session import (
    LANE_CHANGE_MODE_NONE,
    LANE_CHANGE_MODE_SUMO,
    SPEED_MODE_SUMO,
    SPEED_MODE_UNCHECKED,
    SPEED_OF_SUMO,
)


@dataclass
class Actor:
    """A host or a merging car.

    Attributes:
        name: SUMO's vehicle id.
        length: Its length [m].
        min_gap: SUMO's minimum gap of it [m], which SUMO takes off the gaps that it reports.
        lane: Where it drives, None off the ramp.
        x: Its front bumper [m past the gore].
        speed: Its speed [m/s].
        sumo_lane: SUMO's id of the lane.
        has_come: It has been on the ramp's paths.
        goes_on: The lane leads to the next edge of its route, or its route ends there.
        driven: It is a host that the method drives.
    """

    name: str
    length: float
    min_gap: float
    lane: RampLane | None = None
    x: float = 0.0
    speed: float = 0.0
    sumo_lane: str = ""
    has_come: bool = False
    goes_on: bool = True
    driven: bool = False

    @property
    def copy(self) -> str:
        """The copy of the ramp that it drives on; empty off the ramp, too."""
        return self.lane.copy if self.lane is not None else ""

    def is_on(self, part: Part) -> bool:
        """Whether it drives on this part of the ramp."""
        return self.lane is not None and self.lane.part is part


class Actors:
    """Keeps the hosts and the merging cars of a running SUMO.

    A host's type, or the host itself, carries the parameter `merge-cosim.role` = `host`. Or it is named as `host`: by
    itself, or by its flow or type if its route leads along the main road past the gore. Merging cars carry `merging`;
    where no type does, they are all cars whose route leads over the on-ramp to the main road.

    The method drives a host on the host lane, up to the edge on which its route leaves that lane. Elsewhere SUMO does.

    Attributes:
        hosts, merging: Those in the net, by SUMO's id; a merging car is forgotten once `forget` says so.
        came: Names of all hosts that have come in so far.
    """

    def __init__(self, api: Any, lanes: RampLanes, host: str = "") -> None:
        self._api = api
        self._lanes = lanes
        self._host = host
        self._role_of_type: dict[str, str] = {}
        self.hosts: dict[str, Actor] = {}
        self.merging: dict[str, Actor] = {}
        self.came: set[str] = set()
        self._roles_merging = any(self._type_role(kind) == "merging" for kind in api.vehicletype.getIDList())
        for name in api.vehicle.getIDList():
            self._enter(name)

    def update(self) -> None:
        """Take in who came and who left in the last step, and where all are."""
        simulation = self._api.simulation
        for name in simulation.getArrivedIDList():
            self.hosts.pop(name, None)
            self.merging.pop(name, None)
        for name in simulation.getDepartedIDList():
            self._enter(name)
        vehicle, lanes = self._api.vehicle, self._lanes
        for actors in (self.hosts, self.merging):
            for actor in actors.values():
                sumo_lane = vehicle.getLaneID(actor.name)
                if sumo_lane != actor.sumo_lane:
                    actor.sumo_lane, actor.lane = sumo_lane, lanes[sumo_lane]
                    actor.goes_on = actor.name not in self.hosts or self._goes_on(actor)
                lane = actor.lane
                actor.speed = round(vehicle.getSpeed(actor.name), DECIMALS)
                if lane is not None:
                    actor.has_come = True
                    actor.x = round(lane.start + vehicle.getLanePosition(actor.name), DECIMALS)
        for host in self.hosts.values():
            if host.driven != (host.is_on(Part.HOST) and host.goes_on):
                self._drive(host, not host.driven)

    def forget(self, merging: str) -> None:
        """Watch a merging car no longer."""
        self.merging.pop(merging, None)

    def role(self, name: str) -> str:
        """`host`, `merging` or nothing."""
        kind = self._api.vehicle.getTypeID(name)
        if self._host:
            if name == self._host:
                return "host"
            route = self._api.vehicle.getRoute(name)
            if self._host in (kind, name.rpartition(".")[0]) and self._lanes.comes_by_main(route):
                return "host"
        own = self._api.vehicle.getParameter(name, ROLE) or self._type_role(kind)
        if own or self._roles_merging:
            return str(own)
        return "merging" if self._lanes.comes_by_ramp(self._api.vehicle.getRoute(name)) else ""

    def _enter(self, name: str) -> None:
        role, vehicle = self.role(name), self._api.vehicle
        if role not in ("host", "merging"):
            return
        actor = Actor(name, vehicle.getLength(name), vehicle.getMinGap(name))
        if role == "merging":
            self.merging[name] = actor
            return
        self.hosts[name] = actor
        self.came.add(name)

    def _goes_on(self, host: Actor) -> bool:
        vehicle = self._api.vehicle
        onward = vehicle.getRoute(host.name)[vehicle.getRouteIndex(host.name) + 1 :]
        if not onward or not host.sumo_lane:
            return True
        return any(link[0].rpartition("_")[0] == onward[0] for link in self._api.lane.getLinks(host.sumo_lane))

    def _drive(self, host: Actor, method: bool) -> None:
        """Give the wheel to the method, or back to SUMO."""
        vehicle, host.driven = self._api.vehicle, method
        vehicle.setSpeedMode(host.name, SPEED_MODE_UNCHECKED if method else SPEED_MODE_SUMO)
        vehicle.setLaneChangeMode(host.name, LANE_CHANGE_MODE_NONE if method else LANE_CHANGE_MODE_SUMO)
        if not method:
            vehicle.setSpeed(host.name, SPEED_OF_SUMO)

    def _type_role(self, kind: str) -> str:
        if kind not in self._role_of_type:
            self._role_of_type[kind] = self._api.vehicletype.getParameter(kind, ROLE)
        return self._role_of_type[kind]

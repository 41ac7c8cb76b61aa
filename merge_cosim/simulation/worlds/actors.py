"""The hosts and the cars that have not merged yet in a running SUMO, read in every cycle."""

from __future__ import annotations

from dataclasses import dataclass

from merge_cosim.core.observation import DECIMALS
from merge_cosim.sumo.lane_map import LaneMap, Part, RampLane
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.vehicle_types import ROLE


@dataclass
class Actor:
    """A host or a merging car.

    Attributes:
        name: SUMO's vehicle id.
        length: Its length [m].
        lane: Where it drives, None off the ramp.
        x: Its front bumper [m past the gore].
        speed: Its speed [m/s].
        sumo_lane: SUMO's id of the lane.
        has_come: It has been on one of the ramp's paths.
        goes_on: The lane leads to the next edge of its route, or its route ends there.
        driven: It is a host that the method drives.
    """

    name: str
    length: float
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
        hosts, merging: Those in the net, by SUMO's id; merging cars until `forget` is called.
        came: Names of all hosts that have entered so far.
        merging_came: Number of merging cars that have entered so far.
        roles_merging: A type carries the role `merging`, so that only its cars merge.
        departed: Names of all vehicles that have entered so far.
    """

    def __init__(self, session: Session, lanes: LaneMap, host: str = "") -> None:
        self._session = session
        self._lanes = lanes
        self._host = host
        self._role_of_type: dict[str, str] = {}
        self.hosts: dict[str, Actor] = {}
        self.merging: dict[str, Actor] = {}
        self.came: set[str] = set()
        self.merging_came = 0
        self.departed: set[str] = set()
        self.roles_merging = any(self._type_role(kind) == "merging" for kind in session.kinds())
        for name in session.vehicles():
            self._enter(name)

    def update(self) -> None:
        """Read which cars entered and left in the last step, and the positions of all."""
        session, lanes = self._session, self._lanes
        for name in session.arrived():
            self.hosts.pop(name, None)
            self.merging.pop(name, None)
        for name in session.departed():
            self._enter(name)
        for actors in (self.hosts, self.merging):
            for actor in actors.values():
                sumo_lane = session.lane(actor.name)
                if sumo_lane != actor.sumo_lane:
                    actor.sumo_lane, actor.lane = sumo_lane, lanes[sumo_lane]
                    any_lane = not sumo_lane or actor.name not in self.hosts
                    actor.goes_on = any_lane or session.follows_route(actor.name, sumo_lane)
                lane = actor.lane
                actor.speed = round(session.speed(actor.name), DECIMALS)
                if lane is not None:
                    actor.has_come = True
                    actor.x = round(lane.start + session.lane_position(actor.name), DECIMALS)
        for host in self.hosts.values():
            if host.driven != (host.is_on(Part.HOST) and host.goes_on):
                self._drive(host, not host.driven)

    def forget(self, merging: str) -> None:
        """Stop reading a merging car."""
        self.merging.pop(merging, None)

    def role(self, name: str) -> str:
        """`host`, `merging` or nothing."""
        session = self._session
        kind = session.kind(name)
        if self._host:
            if name == self._host:
                return "host"
            if self._host in (kind, name.rpartition(".")[0]) and self._lanes.comes_by_main(session.route(name)):
                return "host"
        own = session.parameter(name, ROLE) or self._type_role(kind)
        if own or self.roles_merging:
            return own
        return "merging" if self._lanes.comes_by_ramp(session.route(name)) else ""

    def _enter(self, name: str) -> None:
        self.departed.add(name)
        role = self.role(name)
        if role not in ("host", "merging"):
            return
        actor = Actor(name, self._session.length(name))
        if role == "merging":
            self.merging[name] = actor
            self.merging_came += 1
            return
        self.hosts[name] = actor
        self.came.add(name)

    def _drive(self, host: Actor, method: bool) -> None:
        """Let the method drive a host, or give it back to SUMO."""
        host.driven = method
        if method:
            self._session.take_control(host.name)
        else:
            self._session.release(host.name)

    def _type_role(self, kind: str) -> str:
        if kind not in self._role_of_type:
            self._role_of_type[kind] = self._session.kind_parameter(kind, ROLE)
        return self._role_of_type[kind]

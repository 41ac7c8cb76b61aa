"""Living traffic on a ramp as ordinary SUMO files: drivers, flows with hosts among them, and speed signs."""

from __future__ import annotations

import math
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lxml import etree
from pydantic import NonNegativeFloat, PositiveFloat, PositiveInt

from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.view import copy_view
from merge_cosim.sumo.routes import configuration
from merge_cosim.sumo.tiles import tile_id, tile_net
from merge_cosim.sumo.vehicle_types import COLORS, DRIVERS, ROLE, VehicleType, distribution
from merge_cosim.sumo.xml import element, flow, speed_sign, write_xml

SUBLANE = 0.8
"""Width of a sublane [m], which the lane-change model SL2015 works with."""
HOST_LENGTH = 4.7
"""Length of a host [m]."""


@dataclass(frozen=True)
class Demand:
    """The traffic of a scene: how many cars, and SUMO's models.

    Cars come at random (exponential) intervals, those of the on-ramp at equal ones, as behind a ramp meter. A wave is a
    speed sign over the main road past the ramp: it slows all cars there at intervals, and stop-and-go waves run
    upstream.

    Attributes:
        duration: Length of a scene [s].
        warm_up: Hosts begin to come at this time, and the throughput is counted from it on [s].
        through: Cars per hour that stay on the main road.
        leaving: Cars per hour from the main road to the off-ramp, where there is one.
        merging: Cars per hour on the on-ramp.
        hosts: Hosts per hour, in the host lane.
        car_following: SUMO's car-following model.
        lane_changing: SUMO's lane-change model; SL2015 works with sublanes.
        imperfection: `sigma` of Krauss and of EIDM; IDM has none.
        speed_deviation: Deviation of the drivers' desired speeds, as a share of the limit.
        cooperative: How willing drivers are to make room, 0 to 1 (`lcCooperative`).
        assertive: How small a gap a driver accepts for a necessary lane change (`lcAssertive`).
        ramp_speed: Speed limit of the on-ramp [m/s]; 0 for that of the net.
        wave_every: Time from one wave to the next [s]; 0 for none.
        wave_lasts: How long a wave's sign is on [s].
        wave_speed: Speed on the sign [m/s].
        copies: Copies of the ramp in the net, each with this demand.
    """

    duration: PositiveFloat = 600.0
    warm_up: NonNegativeFloat = 60.0
    through: NonNegativeFloat = 4000.0
    leaving: NonNegativeFloat = 200.0
    merging: NonNegativeFloat = 400.0
    hosts: NonNegativeFloat = 180.0
    car_following: Literal["Krauss", "IDM", "EIDM"] = "EIDM"
    lane_changing: Literal["LC2013", "SL2015"] = "LC2013"
    imperfection: NonNegativeFloat = 0.3
    speed_deviation: NonNegativeFloat = 0.1
    cooperative: NonNegativeFloat = 1.0
    assertive: PositiveFloat = 1.0
    ramp_speed: NonNegativeFloat = 0.0
    wave_every: NonNegativeFloat = 0.0
    wave_lasts: NonNegativeFloat = 30.0
    wave_speed: PositiveFloat = 3.0
    copies: PositiveInt = 1

    def __post_init__(self) -> None:
        if not self.warm_up < self.duration < math.inf:
            raise ValueError(f"warm_up ({self.warm_up:g} s) must be less than duration ({self.duration:g} s), a number")


def write_traffic(folder: Path, demand: Demand, ramp: Ramp) -> Path:
    """Write net, ramp, routes, signs and configuration of a scene into a folder and return its `traffic.sumocfg`."""
    folder.mkdir(parents=True, exist_ok=True)
    copied = demand.copies > 1
    net = tile_net(ramp, demand.copies, whole=True) if copied else ramp.net
    for file in (net, *ramp.net.parent.glob("ramp.toml")):
        shutil.copyfile(file, folder / file.name)
    prefixes = [tile_id(copy, "") for copy in range(demand.copies)] if copied else [""]
    write_xml(folder / "traffic.rou.xml", _routes(demand, ramp, prefixes))
    signs = _signs(demand, ramp, prefixes)
    write_xml(folder / "traffic.add.xml", signs)
    view = copy_view(ramp.net.parent, folder)
    processing = {"lateral-resolution": str(SUBLANE)} if demand.lane_changing == "SL2015" else {}
    additional = {"additional-files": "traffic.add.xml"} if len(signs) else {}
    inputs = {"net-file": net.name, "route-files": "traffic.rou.xml", **additional}
    target = folder / "traffic.sumocfg"
    write_xml(target, configuration(inputs, processing, view, {"end": repr(demand.duration)}))
    return target


def _routes(demand: Demand, ramp: Ramp, prefixes: list[str]) -> etree._Element:
    host = VehicleType(
        "host", length=HOST_LENGTH, color=COLORS["host"], sigma=0.0, speed_deviation=0.0, parameters={ROLE: "host"}
    )
    kinds = (host.element(), _drivers(demand, "through"), _drivers(demand, "merging", {ROLE: "merging"}))
    root = element("routes", {}, *kinds)
    exits = _exit_route(ramp)
    flows = {
        "through": ("through", demand.through, ramp.main_route, "random", False),
        "leaving": ("through", demand.leaving if exits else 0.0, exits, "first", False),
        "merging": ("merging", demand.merging, ramp.ramp_route, "first", True),
        "host": ("host", demand.hosts, ramp.main_route, str(ramp.main[0].lane), False),
    }
    for name, (kind, per_hour, route, lane, even) in flows.items():  # hosts last: SUMO reads flows in time's order
        begin = demand.warm_up if name == "host" else 0.0
        for prefix in prefixes if per_hour else ():
            edges = [prefix + edge for edge in route]
            root.append(flow(prefix + name, kind, edges, per_hour, even, begin, demand.duration, departLane=lane))
    return root


def _drivers(demand: Demand, name: str, parameters: dict[str, str] | None = None) -> etree._Element:
    """The kinds of drivers of a flow; each type carries the parameters."""
    return distribution(
        name,
        DRIVERS,
        car_following=demand.car_following,
        lane_changing=demand.lane_changing,
        speed_deviation=demand.speed_deviation,
        cooperative=demand.cooperative,
        assertive=demand.assertive,
        sigma=demand.imperfection if demand.car_following != "IDM" else None,
        color=COLORS.get(name),
        parameters=parameters or {},
    )


def _exit_route(ramp: Ramp) -> tuple[str, ...]:
    """From the main road over the auxiliary lane to the edge that only this lane leads to; empty if there is none."""
    if not ramp.changes_lane:
        return ()
    shared = ramp.ramp[-1]
    onward = ramp.next_edges(shared.edge, shared.lane)
    exits = [edge for edge in onward if edge not in ramp.main_route]
    return (*ramp.main_route[: ramp.main_route.index(shared.edge) + 1], *exits[:1]) if exits else ()


def _signs(demand: Demand, ramp: Ramp, prefixes: list[str]) -> etree._Element:
    root = element("additional", {})
    if demand.ramp_speed:
        own = [section.edge for section in ramp.ramp if section.edge not in ramp.main_route]
        steps = [(0.0, demand.ramp_speed)]
        root.extend(speed_sign(prefix + lane, steps) for lane in ramp.lanes_of(*own) for prefix in prefixes)
    if demand.wave_every:
        past = [section.edge for section in ramp.main if section.start >= min(ramp.auxiliary_end, ramp.main[-1].start)]
        steps = [(0.0, ramp.speed_limit)]
        begin = demand.wave_every
        while begin < demand.duration:
            steps += [(begin, demand.wave_speed), (begin + demand.wave_lasts, ramp.speed_limit)]
            begin += demand.wave_every
        root.extend(speed_sign(prefix + lane, steps) for lane in ramp.lanes_of(*past) for prefix in prefixes)
    return root

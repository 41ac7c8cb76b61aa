"""SUMO's vehicle types: how a vehicle looks and drives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

from lxml import etree
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core import colors
from merge_cosim.core.colors import rgba
from merge_cosim.sumo.xml import element, number, write_xml

ROLE = "merge-cosim.role"
"""Parameter of a vehicle type: `host` or `merging`."""
MERGE_POSITION = "merge-cosim.merge-position"
"""Parameter of the merging car's type: where its station 0 lies, in m past the gore."""

RGBA = {"host": rgba(colors.HOST), "merging": rgba(colors.MERGING)}
"""Colours of host and merging car."""
COLORS = {role: ",".join(map(str, rgba[:3])) for role, rgba in RGBA.items()}
"""The same as text of SUMO's files."""


def _named(name: str) -> Any:
    """An attribute of SUMO's element vType; None leaves SUMO's default."""
    return field(default=None, metadata={"sumo": name})


@dataclass(frozen=True)
class VehicleType:
    """A vehicle type; what is None is left to SUMO.

    Attributes:
        id: Its id.
        car_following: SUMO's car-following model.
        lane_changing: SUMO's lane-changing model.
        probability: Share of a distribution's vehicles that are of this type.
        length: Length [m].
        min_gap: Gap to the car ahead at standstill [m].
        tau: Time gap that the driver keeps [s].
        accel, decel: Comfortable acceleration and deceleration [m/s^2].
        max_speed: Greatest speed [m/s].
        sigma: Imperfection of the driver, 0 to 1.
        speed_deviation: Deviation of the desired speed, as a share of the limit.
        speed_factor: Distribution of desired speeds as a factor of the limit, in SUMO's words.
        assertive: How small a gap a driver accepts for a necessary lane change (`lcAssertive`).
        strategic: How early the driver wants to change (`lcStrategic`).
        cooperative: How willing the driver is to make room (`lcCooperative`), 0 to 1.
        speed_gain: How eager the driver is to change for a faster lane (`lcSpeedGain`).
        keep_right: How eager the driver is to keep right (`lcKeepRight`).
        color: Red, green and blue, 0 to 255, with commas.
        parameters: Parameters of its own.
    """

    id: str
    car_following: str | None = _named("carFollowModel")
    lane_changing: str | None = _named("laneChangeModel")
    probability: float | None = _named("probability")
    length: float | None = _named("length")
    min_gap: float | None = _named("minGap")
    tau: float | None = _named("tau")
    accel: float | None = _named("accel")
    decel: float | None = _named("decel")
    max_speed: float | None = _named("maxSpeed")
    sigma: float | None = _named("sigma")
    speed_deviation: float | None = _named("speedDev")
    speed_factor: str | None = _named("speedFactor")
    assertive: float | None = _named("lcAssertive")
    strategic: float | None = _named("lcStrategic")
    cooperative: float | None = _named("lcCooperative")
    speed_gain: float | None = _named("lcSpeedGain")
    keep_right: float | None = _named("lcKeepRight")
    color: str | None = _named("color")
    parameters: Mapping[str, str] = field(default_factory=dict)

    @property
    def attributes(self) -> dict[str, str | float]:
        """What is not left to SUMO, by SUMO's names."""
        values = {one.metadata["sumo"]: getattr(self, one.name) for one in fields(self) if one.metadata}
        return {name: value for name, value in values.items() if value is not None}

    def element(self) -> etree._Element:
        """The type as a part of a route file."""
        given = {name: value if isinstance(value, str) else number(value) for name, value in self.attributes.items()}
        parameters = (element("param", {"key": key, "value": value}) for key, value in self.parameters.items())
        return element("vType", {"id": self.id, **given}, *parameters)


CONTROLLED = VehicleType("controlled", min_gap=0.0, sigma=0.0, speed_deviation=0.0)
"""A car that a method or a merging car's model drives."""


@dataclass(frozen=True)
class Drivers:
    """A share of the drivers in SUMO's own traffic, in the terms of its model EIDM (Salles, Kaufmann, Reuss 2020).

    Attributes:
        share: Their share of the traffic.
        length: Length of their cars [m].
        tau: Time gap that they keep [s].
        accel, decel: Comfortable acceleration and deceleration [m/s^2].
    """

    share: float
    length: float
    tau: float
    accel: float
    decel: float


DRIVERS = (
    Drivers(share=0.40, length=4.7, tau=0.5, accel=2.2, decel=3.0),
    Drivers(share=0.30, length=5.2, tau=0.7, accel=1.8, decel=2.5),
    Drivers(share=0.27, length=4.4, tau=0.35, accel=2.5, decel=3.0),
    Drivers(share=0.03, length=14.0, tau=1.0, accel=1.0, decel=2.0),
)
"""Usual, careful and hurried drivers, and trucks. Their time gaps are shorter than drivers say they keep: so are the
gaps in NGSIM's dense traffic, and SUMO's cars keep theirs more strictly than people do."""


def distribution(name: str, drivers: Iterable[Drivers], **common: Any) -> etree._Element:
    """Kinds of drivers as a distribution of types, which are called `NAME-0`, `NAME-1` and so on.

    Args:
        name: Its id.
        drivers: The kinds.
        common: Fields of `VehicleType` that all of them share.
    """
    kinds = element("vTypeDistribution", {"id": name})
    for count, one in enumerate(drivers):
        kind = VehicleType(
            f"{name}-{count}",
            probability=one.share,
            length=one.length,
            tau=one.tau,
            accel=one.accel,
            decel=one.decel,
            **common,
        )
        kinds.append(kind.element())
    return kinds


LOGGED_TYPE = "logged"
"""Id of the type of all logged cars. A log's commands override its models until a car is released."""
_USUAL = DRIVERS[0]


@dataclass(frozen=True)
class ReleasedDrivers:
    """How a logged car drives once it is handed to SUMO; the defaults are the usual driver's, without its scatter.

    Attributes:
        car_following: SUMO's car-following model.
        lane_changing: SUMO's lane-changing model.
        tau: Time gap that the driver keeps [s].
        accel, decel: Comfortable acceleration and deceleration [m/s^2].
        min_gap: Gap to the car ahead at standstill [m].
    """

    car_following: Literal["Krauss", "IDM", "EIDM"] = "EIDM"
    lane_changing: Literal["LC2013", "SL2015"] = "LC2013"
    tau: PositiveFloat = _USUAL.tau
    accel: PositiveFloat = _USUAL.accel
    decel: PositiveFloat = _USUAL.decel
    min_gap: NonNegativeFloat = 2.0

    def write(self, path: Path) -> None:
        """Write the type as a file for SUMO's option `additional-files`, which must be loaded before the cars come."""
        kind = VehicleType(
            LOGGED_TYPE,
            self.car_following,
            self.lane_changing,
            tau=self.tau,
            accel=self.accel,
            decel=self.decel,
            min_gap=self.min_gap,
            sigma=0.0,
            speed_deviation=0.0,
            max_speed=100.0,  # so that no log is too fast for it
        )
        write_xml(path, element("additional", {}, kind.element()))


DEFAULT_DRIVERS = ReleasedDrivers()

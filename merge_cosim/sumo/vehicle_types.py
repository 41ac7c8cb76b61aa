"""How a logged car drives once it is handed to SUMO: its vehicle type, which SUMO must have loaded before."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lxml import etree
from pydantic import NonNegativeFloat, PositiveFloat

LOGGED_TYPE = "logged"
"""Id of the type of all logged cars. A log's commands override its models until a car is released."""


@dataclass(frozen=True)
class ReleasedDrivers:
    """A driver in SUMO's terms; the defaults are those of the surrogate's usual driver, without its scatter.

    Attributes:
        car_following: SUMO's car-following model.
        lane_changing: SUMO's lane-changing model.
        tau: Time gap that he keeps [s].
        accel, decel: Comfortable acceleration and deceleration [m/s^2].
        min_gap: Gap to the car ahead at standstill [m].
    """

    car_following: Literal["Krauss", "IDM", "EIDM"] = "EIDM"
    lane_changing: Literal["LC2013", "SL2015"] = "LC2013"
    tau: PositiveFloat = 0.5
    accel: PositiveFloat = 2.2
    decel: PositiveFloat = 3.0
    min_gap: NonNegativeFloat = 2.0

    def write(self, path: Path) -> None:
        """Write the type as a file for SUMO's option `additional-files`."""
        root = etree.Element("additional")
        etree.SubElement(
            root,
            "vType",
            id=LOGGED_TYPE,
            carFollowModel=self.car_following,
            laneChangeModel=self.lane_changing,
            tau=repr(self.tau),
            accel=repr(self.accel),
            decel=repr(self.decel),
            minGap=repr(self.min_gap),
            sigma="0",
            speedDev="0",
            maxSpeed="100",  # [m/s] so that no log is too fast for it
        )
        path.write_bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


DEFAULT_DRIVERS = ReleasedDrivers()

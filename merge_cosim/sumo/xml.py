"""Elements of SUMO's XML files that several of our files hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from lxml import etree

from merge_cosim.core.units import HOUR


def element(tag: str, attributes: Mapping[str, str], *children: etree._Element) -> etree._Element:
    """An XML element with its children."""
    made = etree.Element(tag, dict(attributes))
    made.extend(children)
    return made


def number(value: float) -> str:
    """A number as XML text, without loss."""
    return repr(float(value))


def write_xml(path: Path, root: etree._Element) -> None:
    """Write an XML file."""
    path.write_bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def flow(
    name: str, kind: str, route: Sequence[str], per_hour: float, even: bool, begin: float, end: float, **how: str
) -> etree._Element:
    """A flow of vehicles.

    Args:
        name: Its id.
        kind: Their type.
        route: Edge ids.
        per_hour: Vehicles per hour.
        even: They come at even intervals; else at random ones, exponentially distributed.
        begin: From when on they come [s].
        end: Until when [s].
        how: Where and how fast they depart and arrive, by SUMO's names; `departSpeed` is SUMO's `avg`.
    """
    apart = HOUR / per_hour
    attributes = {
        "id": name,
        "type": kind,
        "begin": number(begin),
        "end": number(end),
        "period": number(apart) if even else f"exp({1 / apart!r})",
        "departSpeed": "avg",
    }
    return element("flow", attributes | how, element("route", {"edges": " ".join(route)}))


def speed_sign(lane: str, steps: Sequence[tuple[float, float]]) -> etree._Element:
    """A variable speed sign over a lane: from each time [s] on the speed limit is the speed beside it [m/s]."""
    shown = (element("step", {"time": number(time), "speed": number(speed)}) for time, speed in steps)
    return element("variableSpeedSign", {"id": lane, "lanes": lane}, *shown)

"""Small road maps for the corpus of ramps: ways of OpenStreetMap, and SUMO's plain XML."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import sumolib

from merge_cosim.core.programs import run_program
from merge_cosim.ramps.build import netconvert
from merge_cosim.ramps.create.folder import opening

Point = tuple[float, float]
LATITUDE, LONGITUDE = 48.2, 11.65
UNVALIDATED = ("--xml-validation", "never")
"""To read SUMO's schemas takes a quarter of netconvert's time; ours are right by `opening`."""
METRES = 111_320.0
"""A degree of latitude [m]."""


def osm(
    folder: Path,
    ways: Mapping[int, tuple[Sequence[Point], Mapping[str, str]]],
    signals: Sequence[Point] = (),
    deleted: Sequence[int] = (),
    at: Point = (LATITUDE, LONGITUDE),
) -> Path:
    """An extract whose ways go through points [m] from `at`; ways meet where they share one.

    `signals` are ramp meters, `deleted` ways that an editor has marked so.
    """
    numbers: dict[Point, int] = {}
    for points, _ in ways.values():
        for point in points:
            numbers.setdefault(point, len(numbers) + 1)
    rows = []
    for (x, y), number in numbers.items():
        lat, lon = at[0] + y / METRES, at[1] + x / METRES / math.cos(math.radians(at[0]))
        tag = '<tag k="highway" v="traffic_signals"/>' if (x, y) in signals else ""
        rows.append(f'<node id="{number}" lat="{lat:.7f}" lon="{lon:.7f}" version="1">{tag}</node>')
    for way, (points, tags) in ways.items():
        action = ' action="delete"' if way in deleted else ""
        rows.append(f'<way id="{way}" version="1"{action}>')
        rows += [f'<nd ref="{numbers[point]}"/>' for point in points]
        rows += [f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in {"oneway": "yes", **tags}.items()]
        rows.append("</way>")
    file = folder / "extract.osm"
    file.write_text("<osm version='0.6'>\n" + "\n".join(rows) + "\n</osm>\n", encoding="utf-8")
    return file


def plain(
    folder: Path,
    edges: Mapping[str, tuple[Sequence[Point], int, float, Mapping[str, str]]],
    connections: Sequence[tuple[str, int, str, int]] = (),
    *options: str,
) -> Path:
    """A net of edges through points [m], each with lanes, speed [m/s] and more attributes."""
    ends = {
        point: f"n{number}"
        for number, point in enumerate(
            dict.fromkeys(point for points, *_ in edges.values() for point in (points[0], points[-1]))
        )
    }
    nodes = [f'<node id="{name}" x="{x}" y="{y}"/>' for (x, y), name in ends.items()]
    rows = []
    for name, (points, lanes, speed, more) in edges.items():
        shape = " ".join(f"{x},{y}" for x, y in points)
        given = " ".join(f"{key}={quoteattr(value)}" for key, value in more.items() if key != "shoulder")
        inside = f'<lane index="0" allow="{more["shoulder"]}"/>' if "shoulder" in more else ""
        rows.append(
            f'<edge id="{name}" from="{ends[points[0]]}" to="{ends[points[-1]]}" numLanes="{lanes}" speed="{speed}" '
            f'shape="{shape}" {given}>{inside}</edge>'
        )
    links = [f'<connection from="{a}" fromLane="{i}" to="{b}" toLane="{j}"/>' for a, i, b, j in connections]
    words: list[str] = []
    for kind, flag, root, content in (
        ("nod", "-n", "nodes", nodes),
        ("edg", "-e", "edges", rows),
        ("con", "-x", "connections", links),
    ):
        file = folder / f"source.{kind}.xml"
        file.write_text(f"{opening(root)}{''.join(content)}</{root}>", encoding="utf-8")
        words += [flag, str(file)]
    target = folder / "source.net.xml"
    netconvert(target, *words, "-o", str(target), "--no-turnarounds", *UNVALIDATED, *options)
    return target


def opendrive(folder: Path, net: Path) -> Path:
    """A net that was written as OpenDRIVE and read again."""
    target = folder / "road.xodr"
    netconvert(net, "-s", str(net), "--opendrive-output", str(target), *UNVALIDATED)
    again = folder / "again.net.xml"
    netconvert(target, "--opendrive-files", str(target), "-o", str(again))
    return again


def generated(folder: Path, *options: str) -> Path:
    """A net of netgenerate."""
    target = folder / "generated.net.xml"
    run_program([sumolib.checkBinary("netgenerate"), *options, "-o", str(target)], 60.0, target)
    return target

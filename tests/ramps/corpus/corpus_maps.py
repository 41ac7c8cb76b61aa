"""Ramps of the corpus as mappers draw them in OpenStreetMap."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import corpus_sources as sources
from corpus_case import END, FAR, GORE, Case
from corpus_sources import Point


def road(
    *points: Point, lanes: int = 2, kind: str = "motorway", **tags: str
) -> tuple[Sequence[Point], Mapping[str, str]]:
    given = {"highway": kind, "lanes": str(lanes), "maxspeed": "120"} | {
        k.replace("_", ":"): v for k, v in tags.items()
    }
    return points, given


def link(*points: Point, lanes: int = 1, **tags: str) -> tuple[Sequence[Point], Mapping[str, str]]:
    return road(*points, lanes=lanes, kind=tags.pop("kind", "motorway_link"), **{"maxspeed": "80"} | tags)


IN, ON = (-600.0, -90.0), (-200.0, -20.0)


def osm(
    name: str,
    ways: dict[int, tuple[Sequence[Point], Mapping[str, str]]],
    main: str,
    ramp: str,
    from_left: int,
    lane: bool = True,
    signals: Sequence[Point] = (),
    deleted: Sequence[int] = (),
    at: Point = (sources.LATITUDE, sources.LONGITUDE),
    refused: str = "",
    **numbers: object,
) -> Case:
    def make(folder: Path) -> Path:
        return sources.osm(folder, ways, signals, deleted, at)

    numbers.setdefault("link", ramp.split()[-1])
    return Case(name, make, main.split(), ramp.split(), from_left, lane, numbers, refused)


def exit_at(x: float, **tags: str) -> tuple[Sequence[Point], Mapping[str, str]]:
    return link((x, 0.0), (x + 150.0, -15.0), (x + 500.0, -120.0), **tags)


def main(
    *stops: float, lanes: Sequence[int] = (), first: int = 1, **tags: str
) -> dict[int, tuple[Sequence[Point], Mapping[str, str]]]:
    """A straight main road in ways numbered from `first`, split at x [m]."""
    ends = [FAR, *stops, END]
    each = lanes or [2] * (len(ends) - 1)
    return {
        first + n: road((a, 0.0), (b, 0.0), lanes=count, **tags)
        for n, (a, b, count) in enumerate(zip(ends[:-1], ends[1:], each, strict=True))
    }


RAMP = link(IN, ON, GORE)
LOOP = [
    (-60.0 - 60.0 * math.sin(a), -80.0 + 60.0 * math.cos(a)) for a in (math.radians(d) for d in range(270, -1, -30))
]

OSM = [
    osm("acceleration lane mapped", {**main(0, 250, lanes=(2, 3, 2)), 9: RAMP}, "1 2 3", "9", 1),
    osm("acceleration lane guessed", {**main(0), 9: RAMP}, "1 2", "9", 1),
    osm("exit 700 m after", {**main(0, 700), 9: RAMP, 8: exit_at(700)}, "1 2 3", "9", 1),
    osm("exit 1200 m after", {**main(0, 1200), 9: RAMP, 8: exit_at(1200)}, "1 2 3", "9", 1),
    osm(
        "exit lane mapped",
        {**main(0, 250, 600, 800, lanes=(2, 3, 2, 3, 2)), 9: RAMP, 8: exit_at(800)},
        "1 2 3 4 5",
        "9",
        1,
    ),
    osm(
        "exit before",
        {**main(-500, 0), 9: RAMP, 8: link((-500.0, 0.0), (-350.0, -40.0), (-250.0, -160.0))},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "exits before and after",
        {**main(-500, 0, 900), 9: RAMP, 8: exit_at(900), 7: link((-500.0, 0.0), (-350.0, -40.0), (-250.0, -160.0))},
        "1 2 3 4",
        "9",
        1,
    ),
    osm(
        "next on-ramp after",
        {**main(0, 900), 9: RAMP, 8: link((400.0, -90.0), (700.0, -20.0), (900.0, 0.0))},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "exit after, then on-ramp",
        {**main(0, 700, 1300), 9: RAMP, 8: exit_at(700), 7: link((900.0, -90.0), (1100.0, -20.0), (1300.0, 0.0))},
        "1 2 3 4",
        "9",
        1,
    ),
    osm(
        "on-ramp before",
        {**main(-600, 0), 9: RAMP, 8: link((-850.0, -90.0), (-750.0, -20.0), (-600.0, 0.0))},
        "1 2 3",
        "9",
        1,
    ),
    osm("weaving to an exit", {**main(0, 350, lanes=(2, 3, 2)), 9: RAMP, 8: exit_at(350)}, "1 2 3", "9", 1),
    osm("lane drop after", {**main(0, 250, 700, lanes=(3, 4, 3, 2)), 9: RAMP}, "1 2 3", "9", 2),
    osm("two-lane on-ramp", {**main(0, 400, lanes=(2, 4, 2)), 9: link(IN, ON, GORE, lanes=2)}, "1 2 3", "9", 1),
    osm(
        "loop ramp",
        {**main(0, 250, lanes=(2, 3, 2)), 9: link(*LOOP, (-30.0, -6.0), GORE, maxspeed="40")},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "collector road",
        {
            **main(-800, 0, 250, lanes=(2, 2, 3, 2)),
            8: link((-800.0, 0.0), (-700.0, -18.0), (-400.0, -18.0), lanes=1),
            9: link((-400.0, -18.0), (-150.0, -14.0), GORE),
            7: link((-700.0, -150.0), (-550.0, -50.0), (-400.0, -18.0)),
        },
        "2 3 4",
        "8 9",
        1,
    ),
    osm(
        "frontage road",
        {
            **main(0, 250, lanes=(2, 3, 2)),
            9: link((-500.0, -60.0), (-200.0, -20.0), GORE),
            8: road((FAR, -60.0), (-500.0, -60.0), (END, -60.0), kind="secondary", maxspeed="60"),
        },
        "1 2 3",
        "9",
        1,
    ),
    osm("ramp meter", {**main(0, 250, lanes=(2, 3, 2)), 9: RAMP}, "1 2 3", "9", 1, signals=[ON]),
    osm(
        "mph",
        {**main(0, 250, lanes=(3, 4, 3), maxspeed="65 mph"), 9: link(IN, ON, GORE, maxspeed="45 mph")},
        "1 2 3",
        "9",
        2,
    ),
    osm(
        "no limit",
        {**main(0, 300, lanes=(2, 3, 2), maxspeed="none"), 9: link(IN, ON, GORE, maxspeed="none")},
        "1 2 3",
        "9",
        1,
    ),
    osm("no limit, guessed lane", {**main(0, maxspeed="none"), 9: RAMP}, "1 2", "9", 1),
    osm("130 km/h, guessed lane", {**main(0, maxspeed="130"), 9: RAMP}, "1 2", "9", 1),
    osm(
        "limit changes",
        {**main(0, 250, 800, lanes=(2, 3, 2, 2)) | {4: road((800.0, 0.0), (END, 0.0), maxspeed="80")}, 9: RAMP},
        "1 2 3 4",
        "9",
        1,
    ),
    osm(
        "trunk road",
        {**main(0, 250, lanes=(2, 3, 2), kind="trunk", maxspeed="100"), 9: link(IN, ON, GORE, kind="trunk_link")},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "trunk becomes motorway",
        {**main(0, 250, lanes=(2, 3, 2)) | {1: road((FAR, 0.0), GORE, kind="trunk")}, 9: RAMP},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "link of several ways",
        {
            **main(0, 250, lanes=(2, 3, 2)),
            8: link((-800.0, -200.0), IN, maxspeed="50"),
            9: link(IN, ON, maxspeed="60"),
            10: link(ON, GORE),
        },
        "1 2 3",
        "8 9 10",
        1,
    ),
    osm(
        "last node of 45 degrees",
        {**main(0, 250, lanes=(2, 3, 2)), 9: link((-600.0, -90.0), (-200.0, -12.0), (-10.0, -10.0), GORE)},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "rest area",
        {
            **main(0, 250, 800, lanes=(2, 3, 2, 2)),
            9: RAMP,
            8: link((800.0, 0.0), (950.0, -20.0), (1000.0, -60.0)),
            7: road((1000.0, -60.0), (1100.0, -60.0), kind="service", maxspeed="30", access="no"),
        },
        "1 2 3 4",
        "9",
        1,
    ),
    osm(
        "split of the motorway",
        {
            **main(0, 250, 900, lanes=(3, 4, 3, 2)),
            9: RAMP,
            8: road((900.0, 0.0), (1200.0, -60.0), (END, -400.0), lanes=1, ref="A 2"),
        },
        "1 2 3",
        "9",
        2,
    ),
    osm("exit lane that drops", {**main(0, 250, 900, lanes=(2, 3, 2, 1)), 9: RAMP, 8: exit_at(900)}, "1 2 3", "9", 1),
    osm(
        "left-hand traffic",
        {
            **main(0, 250, lanes=(2, 3, 2), maxspeed="70 mph"),
            9: link((-600.0, 90.0), (-200.0, 20.0), GORE, maxspeed="50 mph"),
        },
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "left-hand traffic, exit after",
        {
            **main(0, 700, maxspeed="70 mph"),
            9: link((-600.0, 90.0), (-200.0, 20.0), GORE),
            8: link((700.0, 0.0), (850.0, 15.0), (1200.0, 120.0)),
        },
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "two links become one",
        {
            **main(0, 250, lanes=(2, 3, 2)),
            7: link((-600.0, -160.0), (-400.0, -80.0), ON),
            8: link(IN, ON),
            9: link(ON, GORE),
        },
        "1 2 3",
        "8 9",
        1,
    ),
    osm(
        "both carriageways",
        {
            **main(0, 250, lanes=(2, 3, 2)),
            9: RAMP,
            11: road((END, 30.0), (0.0, 30.0)),
            12: road((0.0, 30.0), (FAR, 30.0)),
            19: link((600.0, 120.0), (200.0, 50.0), (0.0, 30.0)),
        },
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "bridge within the lane",
        {**main(0, 120, 250, lanes=(2, 3, 3, 2))}
        | {3: road((120.0, 0.0), (250.0, 0.0), lanes=3, bridge="yes", layer="1"), 9: RAMP},
        "1 2 4",  # netconvert joins 2 and 3, which differ in nothing that it knows
        "9",
        1,
    ),
    osm(
        "bus lane on the left",
        {
            1: road((FAR, 0.0), GORE, lanes=3, bus_lanes="designated||", access_lanes="no||"),
            2: road(GORE, (250.0, 0.0), lanes=4, bus_lanes="designated|||", access_lanes="no|||"),
            3: road((250.0, 0.0), (END, 0.0), lanes=3, bus_lanes="designated||", access_lanes="no||"),
            9: RAMP,
        },
        "1 2 3",
        "9",
        2,
    ),
    osm(
        "turn lanes tagged",
        {**main(0, 250, lanes=(2, 3, 2))}
        | {2: road(GORE, (250.0, 0.0), lanes=3, turn_lanes="through|through|merge_to_left"), 9: RAMP},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "link drawn against its direction",
        {**main(0, 250, lanes=(2, 3, 2)), 9: link(GORE, ON, IN, oneway="-1")},
        "1 2 3",
        "9",
        1,
        link=None,
    ),
    osm(
        "without numbers of lanes",
        {
            1: ([(FAR, 0.0), GORE], {"highway": "motorway", "maxspeed": "120"}),
            2: ([GORE, (END, 0.0)], {"highway": "motorway", "maxspeed": "120"}),
            9: ([IN, ON, GORE], {"highway": "motorway_link"}),
        },
        "1 2",
        "9",
        1,
    ),
    osm(
        "name changes at the gore",
        {**main(0, 250, lanes=(2, 3, 2), name="B", ref="A 2")}
        | {1: road((FAR, 0.0), GORE, name="A", ref="A 1"), 9: RAMP},
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "fork into two motorways",
        {
            **main(0, 250, 900, lanes=(4, 5, 4, 2), name="A1"),
            9: RAMP,
            8: road((900.0, 0.0), (1200.0, -60.0), (END, -400.0), lanes=2, name="A2"),
        },
        "1 2 3 8",
        "9",
        3,
    ),
    osm(
        "link narrows to one lane",
        {**main(0, 250, lanes=(2, 3, 2)), 8: link(IN, ON, lanes=2), 9: link(ON, GORE)},
        "1 2 3",
        "8 9",
        1,
    ),
    osm(
        "60 degrees",
        {**main(0, 250, lanes=(2, 3, 2)), 9: link((-300.0, -520.0), GORE)},
        "1",
        "9",
        0,
        refused="45 degrees or less",
        link=None,
    ),
    osm(
        "limit by signs that change",
        {**main(0, 250, lanes=(2, 3, 2), maxspeed="signals"), 9: RAMP},
        "1",
        "9",
        0,
        refused="--speed-limit",
    ),
    osm(
        "limit by law alone",
        {**main(0, 250, lanes=(2, 3, 2), maxspeed="DE:motorway"), 9: RAMP},
        "1",
        "9",
        0,
        refused="--speed-limit",
    ),
    osm("limit with its unit", {**main(0, 250, lanes=(2, 3, 2), maxspeed="120 km/h"), 9: RAMP}, "1 2 3", "9", 1),
    osm(
        "left-hand traffic in the south",
        {**main(0, 250, lanes=(2, 3, 2)), 9: link((-600.0, 90.0), (-200.0, 20.0), GORE)},
        "1 2 3",
        "9",
        1,
        at=(-33.9, 151.0),
    ),
    osm(
        "deleted in an editor",
        {**main(0, 250, lanes=(2, 3, 2)), 9: RAMP, 8: link((-700.0, -60.0), (-300.0, -40.0), GORE)},
        "1 2 3",
        "9",
        1,
        deleted=[8],
        link=None,
    ),
    osm(
        "map ends 400 m after",
        {
            1: road((FAR, 0.0), GORE),
            2: road(GORE, (250.0, 0.0), lanes=3),
            3: road((250.0, 0.0), (400.0, 0.0)),
            9: RAMP,
        },
        "1 2 3",
        "9",
        1,
    ),
    osm(
        "lane drawn as a link",
        {**main(300), 9: link(IN, ON, (0.0, -6.0), (240.0, -6.0), (300.0, 0.0))},
        "1 2",
        "9",
        1,
    ),
    osm(
        "exit-only lane before",
        {
            **main(-500, 0, 250, lanes=(3, 2, 3, 2)),
            9: RAMP,
            8: link((-500.0, 0.0), (-350.0, -40.0), (-250.0, -160.0)),
        },
        "1 2 3 4",
        "9",
        1,
    ),
    osm(
        "exit on the left after",
        {**main(0, 250, 800, lanes=(2, 3, 2, 2)), 9: RAMP, 8: link((800.0, 0.0), (950.0, 15.0), (1300.0, 120.0))},
        "1 2 3 4",
        "9",
        1,
    ),
    osm(
        "another on-ramp beside the lane",
        {
            **main(0, 150, 400, lanes=(2, 3, 4, 2)),
            9: RAMP,
            8: link((-250.0, -120.0), (50.0, -30.0), (150.0, 0.0)),
        },
        "1 2 3 4",
        "9",
        1,
    ),
    osm("one lane", {**main(0, 250, lanes=(1, 2, 1)), 9: RAMP}, "1 2 3", "9", 0),
    osm("five lanes", {**main(0, 250, lanes=(5, 6, 5)), 9: RAMP}, "1 2 3", "9", 4),
    osm(
        "in a bend",
        {
            1: road((FAR, -300.0), (-400.0, -60.0), GORE),
            2: road(GORE, (150.0, 8.0), (300.0, 10.0), lanes=3),
            3: road((300.0, 10.0), (700.0, -10.0), (1200.0, -150.0), (2100.0, -600.0)),
            9: link((-500.0, -200.0), (-150.0, -50.0), GORE),
        },
        "1 2 3",
        "9",
        1,
    ),
]

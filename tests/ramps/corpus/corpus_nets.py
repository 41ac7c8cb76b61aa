"""Ramps of the corpus as nets: plain XML, netgenerate, OpenDRIVE, `--ramps.guess`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import corpus_sources as sources
from corpus_case import END, FAR, GORE, Case
from corpus_sources import Point


def net(
    name: str,
    edges: dict[str, tuple[Sequence[Point], int, float, Mapping[str, str]]],
    main: str,
    ramp: str,
    from_left: int,
    connections: Sequence[tuple[str, int, str, int]] = (),
    options: Sequence[str] = (),
    lane: bool = True,
    refused: str = "",
    **numbers: object,
) -> Case:
    def make(folder: Path) -> Path:
        return sources.plain(folder, edges, connections, *options)

    return Case(name, make, main.split(), ramp.split(), from_left, lane, numbers, refused)


def straight(
    *stops: float, lanes: Sequence[int], speed: float = 30.0, side: float = -1.0
) -> dict[str, tuple[Sequence[Point], int, float, Mapping[str, str]]]:
    """Main road edges `m0`, `m1`, ..., split at x [m], and an on-ramp `r` that joins at 0 from below or above."""
    ends = [FAR, *stops, END]
    found: dict[str, tuple[Sequence[Point], int, float, Mapping[str, str]]] = {
        f"m{n}": (((a, 0.0), (b, 0.0)), count, speed, {})
        for n, (a, b, count) in enumerate(zip(ends[:-1], ends[1:], lanes, strict=True))
    }
    return found | {"r": (((-600.0, 90.0 * side), (-200.0, 20.0 * side), GORE), 1, 20.0, {})}


OFF = (((700.0, 0.0), (850.0, -15.0), (1200.0, -120.0)), 1, 20.0, {})
GUESS = ("--ramps.guess", "--ramps.ramp-length", "250")
FAN = [("m0", lane, "m1", lane) for lane in range(6)] + [("r", 0, "m1", lane) for lane in range(6)]
FAN_ALL = [("m0", lane, "m1", onto) for lane in range(6) for onto in range(6)] + FAN[6:]
NETS = [
    net("fan-out of the on-ramp", straight(0, lanes=(6, 6)), "m0 m1", "r", 5, FAN, lane=False),
    net("fan-out of both", straight(0, lanes=(6, 6)), "m0 m1", "r", 5, FAN_ALL, lane=False),
    net(
        "fan-out beside a lane of its own",
        straight(0, 300, lanes=(2, 3, 2)),
        "m0 m1 m2",
        "r",
        1,
        [
            ("m0", 0, "m1", 0),
            ("m0", 0, "m1", 1),
            ("m0", 1, "m1", 2),
            ("r", 0, "m1", 0),
            ("r", 0, "m1", 1),
            ("m1", 1, "m2", 0),
            ("m1", 2, "m2", 1),
        ],
    ),
    net("lane without types", straight(0, 300, lanes=(2, 3, 2)), "m0 m1 m2", "r", 1),
    net("ramps.guess", straight(0, lanes=(2, 2)), "m0 m1-AddedOnRampEdge m1", "r", 1, (), GUESS),
    net(
        "ramps.guess with an exit",
        straight(0, 700, lanes=(2, 2, 2)) | {"e": OFF},
        "m0 m1-AddedOnRampEdge m1 m1-AddedOffRampEdge m2",
        "r",
        1,
        (),
        GUESS,
    ),
    net(
        "ramps.guess with an exit, three lanes",
        straight(0, 700, lanes=(3, 3, 3)) | {"e": OFF},
        "m0 m1-AddedOnRampEdge m1 m1-AddedOffRampEdge m2",
        "r",
        2,
        (),
        GUESS,
    ),
    net(
        "guessed lane too short for a fifth",
        straight(0, lanes=(2, 2), speed=36.11),
        "m0 m1-AddedOnRampEdge m1",
        "r",
        1,
        (),
        ("--ramps.guess",),
    ),
    net(
        "taper, no lane",
        straight(0, lanes=(2, 2)),
        "m0 m1",
        "r",
        1,
        [("m0", 0, "m1", 0), ("m0", 1, "m1", 1), ("r", 0, "m1", 0)],
        lane=False,
    ),
    net(
        "from the left",
        straight(0, 300, lanes=(2, 3, 2), side=1.0),
        "m0 m1 m2",
        "r",
        1,
        [("m0", 0, "m1", 0), ("m0", 1, "m1", 1), ("r", 0, "m1", 2), ("m1", 0, "m2", 0), ("m1", 1, "m2", 1)],
    ),
    net("left-hand net", straight(0, 300, lanes=(2, 3, 2), side=1.0), "m0 m1 m2", "r", 1, (), ("--lefthand",)),
    net(
        "left-hand net, fan-out",
        straight(0, lanes=(6, 6), side=1.0),
        "m0 m1",
        "r",
        5,
        FAN_ALL,
        ("--lefthand",),
        lane=False,
    ),
    net(
        "50 km/h",
        straight(0, 300, lanes=(2, 3, 2), speed=13.89) | {"r": (((-600.0, -90.0), (-200.0, -20.0), GORE), 1, 8.33, {})},
        "m0 m1 m2",
        "r",
        1,
    ),
    net(
        "45 degrees",
        straight(0, 300, lanes=(2, 3, 2)) | {"r": (((-400.0, -400.0), GORE), 1, 20.0, {})},
        "m0 m1 m2",
        "r",
        1,
    ),
    net(
        "two-lane on-ramp without types",
        straight(0, 400, lanes=(3, 5, 3)) | {"r": (((-600.0, -90.0), (-200.0, -20.0), GORE), 2, 20.0, {})},
        "m0 m1 m2",
        "r",
        2,
    ),
    net(
        "service road without car access",
        straight(0, 300, 900, lanes=(2, 3, 2, 2))
        | {"s": (((900.0, 0.0), (1200.0, -20.0), (2000.0, -100.0)), 2, 30.0, {"allow": "emergency authority"})},
        "m0 m1 m2 m3",
        "r",
        1,
    ),
    net(
        "exit after as wide as the road",
        straight(0, 300, 900, lanes=(2, 3, 4, 2))
        | {"e": (((900.0, 0.0), (1100.0, -30.0), (1600.0, -200.0)), 2, 25.0, {})},
        "m0 m1 m2 m3",
        "r",
        1,
        [
            ("m0", 0, "m1", 1),
            ("m0", 1, "m1", 2),
            ("r", 0, "m1", 0),
            ("m1", 1, "m2", 2),
            ("m1", 2, "m2", 3),
            ("m2", 0, "e", 0),
            ("m2", 1, "e", 1),
            ("m2", 2, "m3", 0),
            ("m2", 3, "m3", 1),
        ],
    ),
    net(
        "through OpenDRIVE's width of lanes",
        straight(0, 300, lanes=(3, 4, 3)),
        "m0 m1 m2",
        "r",
        2,
        (),
        ("--default.lanewidth", "3.75"),
    ),
    net(
        "hard shoulder",
        {
            name: (points, lanes + (name != "r"), speed, {"shoulder": "emergency"} if name != "r" else {})
            for name, (points, lanes, speed, _) in straight(0, 300, lanes=(2, 3, 2)).items()
        },
        "m0 m1 m2",
        "r",
        1,
        [
            *(("m0", lane, "m1", lane + (lane > 0)) for lane in range(3)),
            ("r", 0, "m1", 1),
            ("m1", 0, "m2", 0),
            ("m1", 2, "m2", 1),
            ("m1", 3, "m2", 2),
        ],
    ),
    Case("grid", lambda folder: sources.generated(folder, "--grid"), (), (), 0, refused="no on-ramp found"),
    Case("spider", lambda folder: sources.generated(folder, "--spider"), (), (), 0, refused="no on-ramp found"),
    net(
        "no lanes inside junctions", straight(0, 300, lanes=(2, 3, 2)), "m0 m1 m2", "r", 1, (), ["--no-internal-links"]
    ),
    net("lane over two edges", straight(0, 150, 300, lanes=(2, 3, 3, 2)), "m0 m1 m2 m3", "r", 1),
    net(
        "opposite direction between the same nodes",
        straight(0, 300, lanes=(2, 3, 2))
        | {
            "-m2": (((END, 0.0), (300.0, 0.0)), 2, 30.0, {}),
            "-m1": (((300.0, 0.0), GORE), 2, 30.0, {}),
            "-m0": ((GORE, (FAR, 0.0)), 2, 30.0, {}),
        },
        "m0 m1 m2",
        "r",
        1,
        [("m0", 0, "m1", 1), ("m0", 1, "m1", 2), ("r", 0, "m1", 0), ("m1", 1, "m2", 0), ("m1", 2, "m2", 1)],
    ),
    net(
        "lines in the middle of the roads",
        {
            name: (points, lanes, speed, {"spreadType": "center"})
            for name, (points, lanes, speed, _) in straight(0, 300, lanes=(2, 3, 2)).items()
        },
        "m0 m1 m2",
        "r",
        1,
    ),
    net(
        "far from the origin",
        straight(0, 300, lanes=(2, 3, 2)),
        "m0 m1 m2",
        "r",
        1,
        (),
        ("--offset.x", "4500000", "--offset.y", "-5300000", "--offset.disable-normalization"),
    ),
    net(
        "two-lane on-ramp with a lane straight on",
        straight(0, 300, lanes=(2, 3, 2)) | {"r": (((-600.0, -90.0), (-200.0, -20.0), GORE), 2, 20.0, {})},
        "m0 m1 m2",
        "r",
        1,
        [
            ("m0", 0, "m1", 1),
            ("m0", 1, "m1", 2),
            ("r", 0, "m1", 0),
            ("r", 1, "m1", 1),
            ("m1", 1, "m2", 0),
            ("m1", 2, "m2", 1),
        ],
        lane=False,
    ),
    net(
        "names with other letters",
        dict(zip(("Süd#0", "-42", "A1:z", "+r"), straight(0, 300, lanes=(2, 3, 2)).values(), strict=True)),
        "Süd#0 -42 A1:z",
        "+r",
        1,
    ),
    net(
        "on-ramp as fast as the road",
        straight(0, 300, lanes=(2, 3, 2)) | {"r": (((-600.0, -90.0), (-200.0, -20.0), GORE), 1, 30.0, {})},
        "m0 m1 m2",
        "r",
        1,
    ),
    net(
        "two roads alike",
        straight(0, 300, lanes=(2, 3, 2)) | {"r": (((-600.0, -90.0), (-200.0, -20.0), GORE), 2, 30.0, {})},
        "",
        "",
        0,
        refused="no on-ramp found",
    ),
    net("lane that goes on", straight(0, lanes=(2, 3)), "", "", 0, refused="goes on"),
    Case(
        "OpenDRIVE",
        lambda folder: sources.opendrive(folder, sources.plain(folder, straight(0, 300, lanes=(2, 3, 2)))),
        ("-50", "-51", "-52"),  # OpenDRIVE's roads have numbers
        ("-53",),
        1,
    ),
]

"""A ramp as encounters use it: two paths in metres past the gore, and where they lie in the SUMO net.

Coordinates: x [m] runs along the main road and is 0 at the gore; on the on-ramp it is minus the way left to the gore.
An encounter has its merging point at x = merge_position, and a station is x - merge_position. x is the plain sum of
edge lengths: junctions have no length, as in SUMO runs without internal links.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.core.units import BoolArray, FloatArray
from merge_cosim.core.xml_file import root_element
from merge_cosim.ramps.definition import FILE_NAME, NgsimMapping, RampFile, read_ramp_file

Way = Literal["main", "ramp"]
"""The host's path and the merging car's."""


@dataclass(frozen=True)
class Section:
    """One edge of a path.

    Attributes:
        edge: Its id.
        lane: SUMO index of the path's lane on it.
        start: x of its start [m].
        length: Its length [m].
    """

    edge: str
    lane: int
    start: float
    length: float

    @cached_property
    def end(self) -> float:
        """X of its end [m]."""
        return round(self.start + self.length, 9)  # nanometres, so that edges end exactly at the gore


@dataclass(frozen=True)
class Ramp:
    """A ramp: its net and the two paths through it.

    Attributes:
        name: Name of its folder.
        title: One line for lists and reports.
        net: The built SUMO net.
        main: The host's path, in driving order.
        ramp: The merging car's path up to its lane change (or up to the gore, where the ramp joins without one).
        merging_point: Default merging point [m past the gore].
        speed_limit: Speed limit [m/s].
        ngsim: Where NGSIM's lanes lie, if the ramp is one of that data set.
    """

    name: str
    title: str
    net: Path
    main: tuple[Section, ...]
    ramp: tuple[Section, ...]
    merging_point: float
    speed_limit: float
    ngsim: NgsimMapping | None = None

    @classmethod
    def load(cls, name_or_folder: str | Path) -> Ramp:
        """Load a shipped ramp by its name, or any by the path to its folder.

        Raises:
            UserError: There is no such ramp, `ramp.toml` is wrong, or the net lacks a named edge or lane.
        """
        folder = find_ramp(name_or_folder)
        return cls.from_file(folder, read_ramp_file(folder))

    @classmethod
    def from_file(cls, folder: Path, file: RampFile) -> Ramp:
        """Build a ramp from its definition and the net beside it."""
        net = read_net(folder / file.net)
        for problem in missing_lanes(net, file):
            raise UserError(f"{folder / FILE_NAME}: {problem}")
        lengths = {edge: float(net.getEdge(edge).getLength()) for edge in file.main + file.ramp}
        gore = file.main.index(file.gore)
        own = [edge for edge in file.ramp if edge not in file.main]
        return cls(
            name=folder.resolve().name,
            title=file.title,
            net=folder / file.net,
            main=_sections(file.main, file.host_lane, lengths, gore),
            ramp=_sections(file.ramp, file.merging_lane, lengths, len(own)),
            merging_point=file.merging_point,
            speed_limit=file.speed_limit,
            ngsim=file.ngsim,
        )

    @cached_property
    def changes_lane(self) -> bool:
        """Whether the merging car changes lane at the merging point (else the ramp joins by a connection)."""
        return self.ramp[-1].end > 0.0

    @cached_property
    def auxiliary_end(self) -> float:
        """X where the auxiliary lane ends [m]; inf if there is none."""
        return self.ramp[-1].end if self.changes_lane else math.inf

    @property
    def upstream(self) -> float:
        """Reach upstream of the gore on both paths [m]."""
        return -max(self.main[0].start, self.ramp[0].start)

    @property
    def downstream(self) -> float:
        """Reach downstream of the gore [m]."""
        return self.main[-1].end

    def summary(self) -> dict[str, str | float | None]:
        """What a list shows of the ramp, ready for JSON."""
        return {
            "name": self.name,
            "title": self.title,
            "net": str(self.net),
            "merging_point_m": self.merging_point,
            "auxiliary_end_m": self.auxiliary_end if self.changes_lane else None,
            "upstream_m": self.upstream,
            "downstream_m": self.downstream,
            "speed_limit_m_s": self.speed_limit,
        }

    @property
    def main_route(self) -> tuple[str, ...]:
        """Edge ids of the main road's route."""
        return tuple(section.edge for section in self.main)

    @property
    def ramp_route(self) -> tuple[str, ...]:
        """Edge ids of the on-ramp's route, which ends where the main road's does."""
        own = tuple(section.edge for section in self.ramp if section.end <= 0.0)
        return own + tuple(section.edge for section in self.main if section.start >= 0.0)

    def route(self, path: Way) -> tuple[str, ...]:
        """Edge ids of a path's route."""
        return self.main_route if path == "main" else self.ramp_route

    def lanes_of(self, *edges: str) -> tuple[str, ...]:
        """SUMO ids of the lanes of some edges, from the right."""
        net = read_net(self.net)
        return tuple(str(lane.getID()) for edge in edges for lane in net.getEdge(edge).getLanes())

    def next_edges(self, edge: str, lane: int) -> tuple[str, ...]:
        """Where a lane leads to: edge ids, sorted."""
        outgoing = read_net(self.net).getEdge(edge).getLane(lane).getOutgoing()
        return tuple(sorted({str(link.getTo().getID()) for link in outgoing}))

    def holds(self, merge_position: FloatArray, on_main: FloatArray, on_ramp: FloatArray) -> BoolArray:
        """Which encounters fit: merging point beside the ramp's lane, both starts on the net; shape (n,).

        Args:
            merge_position: Where station 0 lies [m past the gore], shape (n,).
            on_main: Stations at the start of the cars on the main road [m], shape (n,).
            on_ramp: The same of the cars on the ramp.
        """
        beside = (merge_position >= 0.0) & (merge_position <= self.auxiliary_end)
        main, ramp = on_main + merge_position, on_ramp + merge_position
        on_net = (main >= self.main[0].start) & (ramp >= self.ramp[0].start) & (main < self.downstream)
        return np.asarray(beside & on_net)


def ramp_names() -> list[str]:
    """Names of the shipped ramps."""
    return sorted(file.parent.name for file in shipped("sumo_nets").glob(f"*/{FILE_NAME}"))


def find_ramp(name_or_folder: str | Path) -> Path:
    """Folder of a shipped ramp by its name, or of any by its path.

    Raises:
        UserError: There is neither; the line lists the names.
    """
    own, ours = Path(name_or_folder), shipped("sumo_nets") / name_or_folder
    if str(name_or_folder):
        if (ours / FILE_NAME).is_file():
            return ours
        if own.is_dir():
            return own
    raise UserError(f"no ramp '{name_or_folder}': give one of {', '.join(ramp_names())}, or a folder with {FILE_NAME}")


def _sections(edges: list[str], lanes: list[int], lengths: dict[str, float], before: int) -> tuple[Section, ...]:
    """Lay edges end to end so that the edge number `before` starts at x = 0."""
    start = round(-sum(lengths[edge] for edge in edges[:before]), 9)
    sections = []
    for edge, lane in zip(edges, lanes, strict=True):
        sections.append(Section(edge, lane, start, lengths[edge]))
        start = sections[-1].end
    return tuple(sections)


def missing_lanes(net: sumolib.net.Net, file: RampFile) -> list[str]:
    """Edges and lanes that a definition names and a net lacks, a line for each that starts with the key."""
    problems = []
    for key, edges, lanes in (("main", file.main, file.host_lane), ("ramp", file.ramp, file.merging_lane)):
        for edge, lane in zip(edges, lanes, strict=True):
            if not net.hasEdge(edge):
                problems.append(f"{key}: the net {file.net} has no edge '{edge}'")
            elif lane not in range(count := net.getEdge(edge).getLaneNumber()):
                problems.append(f"{key}: edge '{edge}' has no lane {lane}; its lanes are 0 ... {count - 1}")
            elif lengths := _odd_lengths(net.getEdge(edge)):
                problems.append(f"{key}: in the net {file.net} the lanes of edge '{edge}' are {lengths} m long")
    return problems


def _odd_lengths(edge: sumolib.net.edge.Edge) -> str:
    """The lengths of an edge's lanes where they differ (as where its id stands twice) or are none; else empty."""
    lengths = [float(lane.getLength()) for lane in edge.getLanes()]
    good = len(set(lengths)) == 1 and 0.0 < lengths[0] < math.inf
    return "" if good else ", ".join(map(str, lengths))


def read_net(path: Path) -> sumolib.net.Net:
    """Read a SUMO net.

    Raises:
        UserError: The file is missing or no net.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such net; build it with: merge-cosim ramp build {path.parent}")
    if (root := root_element(path)).tag != "net":
        raise UserError(f"{path}: its root is <{root.tag}>, not <net>; give a .net.xml")
    return _net_of(path, path.read_bytes())


@lru_cache(maxsize=8)
def _net_of(path: Path, _content: bytes) -> sumolib.net.Net:
    """A net, parsed once as long as its file is the same: a sweep and `ramp describe` ask many times."""
    return parsed_net(path, path)


def parsed_net(path: Path, named: Path) -> sumolib.net.Net:
    """Parse a net; `named` is the file in error lines.

    Raises:
        UserError: It cannot be parsed, an edge has no junction that is there, or its offset is not two numbers.
    """
    try:
        net = sumolib.net.readNet(str(path))
    except Exception as error:  # sumolib passes on whatever its parser meets
        raise UserError(f"{named}: not a SUMO net: {error}") from None
    for node in net.getNodes():
        if node.getCoord3D() is None:
            raise UserError(f"{named}: not a whole SUMO net: it has no junction '{node.getID()}', which an edge names")
    for edge in net.getEdges():
        if edge.getFromNode() is None or edge.getToNode() is None:
            raise UserError(f"{named}: not a SUMO net: edge '{edge.getID()}' is not internal, but names no junctions")
    offset = net._location.get("netOffset", "0,0")
    try:
        east, north = map(float, offset.split(","))
    except ValueError:
        east = north = math.nan
    if not math.isfinite(east + north):
        raise UserError(f"{named}: not a SUMO net: the netOffset of its location is '{offset}', not two numbers")
    return net

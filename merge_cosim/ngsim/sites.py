"""Sites: what was recorded at a ramp, and how. Each is a file, `site.toml`, in the folder of its ramp."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, NonNegativeInt, PositiveFloat, model_validator

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.core.toml_file import Table, read_toml
from merge_cosim.core.units import FOOT
from merge_cosim.ngsim.formats import COLUMNS, NGSIM, WIDE, Layout
from merge_cosim.ngsim.pairing.rules import PairRules

FILE_NAME = "site.toml"

UNITS = {"m": 1.0, "ft": FOOT}
"""Metres per unit of length."""

POINTS = {"front": 0.0, "centre": 0.5, "rear": 1.0}
"""How many car lengths lie between a logged point of a car and its front bumper."""

_Lanes = tuple[int, ...]


class Lanes(Table):
    """The part of each lane number of the recording.

    Attributes:
        host: The main lane that cars merge into; several numbers where it changes its number along the road.
        ramp: Lanes from which cars merge: on-ramp and auxiliary lane.
        exit: Lanes that go on from those to an off-ramp.
        shared: Numbers that stand for both paths (where two lanes become one) or for no lane: a car keeps the lane that
            it had before, and counts for the host lane if it had none.
    """

    host: Annotated[_Lanes, Field(min_length=1)]
    ramp: Annotated[_Lanes, Field(min_length=1)]
    exit: _Lanes = ()
    shared: _Lanes = ()

    @model_validator(mode="after")
    def _one_part_each(self) -> Self:
        numbers = (*self.host, *self.ramp, *self.exit, *self.shared)
        if twice := [number for number in numbers if numbers.count(number) > 1]:
            raise ValueError(f"lane {twice[0]} is named twice; each lane has one part")
        return self


class Recording(Table):
    """How the trajectory files are written. Lengths here are in the files' own unit.

    Attributes:
        format: `ngsim`: as NGSIM published its files; `columns`: one row per car and frame, the columns named below.
        gore: Position along the road where the ramp joins the main road, x = 0 of the ramp's net.
        unit: Unit of lengths, and of speeds per second.
        columns: The file's name of each canonical column (`formats.COLUMNS`).
        rate: Frames per second; other rates than 10 are resampled.
        skip_first: Frames left out at the start of each car's track, where a tracker is not yet accurate.
        point: The point of a car that its position along the road is of: `front`, `centre` or `rear`.
        smoothed: Positions were smoothed before they were published.
        location: In NGSIM's format: value of the column `Location`.
        global_x, global_y: In NGSIM's format: range of the global coordinates (California State Plane, NAD83, US survey
            feet) that holds the study area with some margin.
        episodes_from: First of NGSIM's published merging episodes to use beside trajectories; None: it has none.
    """

    format: Literal["ngsim", "columns"]
    gore: float
    unit: Literal["m", "ft"]
    columns: dict[str, str] = Field(default_factory=dict)
    rate: PositiveFloat = 10.0
    skip_first: NonNegativeInt = 0
    point: Literal["front", "centre", "rear"] = "front"
    smoothed: bool = False
    location: str = ""
    global_x: tuple[float, float] | None = None
    global_y: tuple[float, float] | None = None
    episodes_from: NonNegativeInt | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.format == "ngsim":
            if wrong := {"columns", "rate", "skip_first", "point", "smoothed"} & self.model_fields_set:
                raise ValueError(f"'{min(wrong)}' is known where format = 'ngsim': leave it out")
            return self
        if unknown := [name for name in self.columns if name not in COLUMNS]:
            raise ValueError(f"columns.{unknown[0]} is no canonical column; these are {', '.join(COLUMNS)}")
        needed = ("vehicle_id", "time" if "time" in self.columns else "frame", "y", "speed", "lane")
        if missing := [name for name in needed if name not in self.columns]:
            raise ValueError(f"columns.{missing[0]} is missing: name the file's column")
        if self.point != "front" and "length" not in self.columns:
            raise ValueError(f"point = '{self.point}' needs columns.length, to find the front")
        return self


class Site(Table):
    """One recorded site.

    Attributes:
        name: Name in tables and results; the folder's if the file gives none.
        title: Name for people.
        length: Length of the recorded road [m].
        lanes: The part of each lane.
        recording: How its files are written.
        pairs: Rules of pairing that differ from the defaults.
        sources: Where each fact comes from, in words.
    """

    name: str
    title: str
    length: PositiveFloat = math.inf
    lanes: Lanes
    recording: Recording
    pairs: PairRules = PairRules()
    sources: dict[str, str] = Field(default_factory=dict)

    @property
    def ramp_lanes(self) -> tuple[int, ...]:
        """Lanes from which cars merge."""
        return self.lanes.ramp

    @property
    def host_lane(self) -> int:
        """The number of the main lane that they merge into; its first one where it has several."""
        return self.lanes.host[0]

    @property
    def exit_lanes(self) -> tuple[int, ...]:
        """Lanes that go on from `ramp_lanes` to an off-ramp."""
        return self.lanes.exit

    @property
    def side_lanes(self) -> tuple[int, ...]:
        """The lanes beside the main road, which are one path: on-ramp, auxiliary lane, off-ramp."""
        return self.ramp_lanes + self.exit_lanes

    @property
    def gore_y(self) -> float:
        """Position along the road where the on-ramp joins it [m]."""
        return self.recording.gore * UNITS[self.recording.unit]

    @property
    def source(self) -> Literal["ngsim", "recorded"]:
        """The value of `source` of its encounters."""
        return "ngsim" if self.recording.format == "ngsim" else "recorded"

    @property
    def layout(self) -> Layout:
        """How its files name the canonical columns."""
        recording = self.recording
        if recording.format == "ngsim":
            return NGSIM
        numbers = {name: column for name, column in recording.columns.items() if name != "recording"}
        return Layout(
            numbers,
            recording=recording.columns.get("recording", ""),
            unit=UNITS[recording.unit],
            limits=WIDE,
            optional=(),
            of_site=True,
            rate=recording.rate,
            skip_first=recording.skip_first,
            to_front=POINTS[recording.point],
            default_length=self.pairs.default_length,
            smoothed=recording.smoothed,
        )


def read_site(folder: Path) -> Site:
    """Read `site.toml` in a ramp's folder.

    Raises:
        UserError: The file is missing, or a key in it is wrong; the line names file and key.
    """
    return read_toml(folder / FILE_NAME, Site, "site", name=folder.resolve().name)


@cache
def shipped_sites() -> tuple[Site, ...]:
    """The sites of the shipped ramps, by name."""
    return tuple(read_site(file.parent) for file in sorted(shipped("sumo_nets").glob(f"*/{FILE_NAME}")))


def site(name_or_folder: str | Path) -> Site:
    """Return a shipped ramp's site by its name (also as the portal spells it), or any by the path of its folder.

    Raises:
        UserError: There is no such site, or its file is wrong.
    """
    for known in shipped_sites():
        if str(name_or_folder).strip().lower() in (known.name, known.recording.location):
            return known
    if str(name_or_folder) and Path(name_or_folder).is_dir():
        return read_site(Path(name_or_folder))
    names = ", ".join(known.name for known in shipped_sites())
    raise UserError(f"unknown site '{name_or_folder}': choose {names}, or a folder with {FILE_NAME}")

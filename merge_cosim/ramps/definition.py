"""The file `ramp.toml`: what a net's edges mean for an encounter, and where each fact comes from."""

from pathlib import Path

from pydantic import Field, PositiveFloat, model_validator

from merge_cosim.core.toml_file import Table, read_toml
from merge_cosim.core.units import SpeedLimit

FILE_NAME = "ramp.toml"


class Extensions(Table):
    """Straight road added beyond the surveyed one, in m past the gore; a missing key means none.

    Attributes:
        main_before: The main road upstream of this place is added.
        main_after: The main road downstream of this place is added.
        ramp_before: The on-ramp upstream of this place is added.
        exit_after: The off-ramp downstream of this place is added.
    """

    main_before: float | None = None
    main_after: float | None = None
    ramp_before: float | None = None
    exit_after: float | None = None


class NgsimMapping(Table):
    """How NGSIM's lanes and Local_Y lie on the net.

    Attributes:
        gore_local_y: Local_Y of the gore [m].
        lanes: SUMO lane ids along the road of each NGSIM lane number.
    """

    gore_local_y: float
    lanes: dict[int, list[str]]


class RampFile(Table):
    """Contents of `ramp.toml`.

    Attributes:
        title: One line for lists and reports.
        net: File name of the built net, beside this file.
        described: The net belongs to the user; this file describes it, and it is not built (`ramp describe`).
        main: Edges of the main road, in driving order.
        host_lane: SUMO lane index of the host on each edge of `main`.
        ramp: Edges of the merging car, in driving order; where there is an auxiliary lane, the last ones are edges of
            `main`, too.
        merging_lane: SUMO lane index of the merging car on each edge of `ramp`.
        gore: The edge of `main` at whose start x = 0, where the ramp comes in.
        merging_point: Default merging point, in m past the gore.
        speed_limit: Speed limit [m/s].
        lengths: Intended length of each edge [m], which the built net is checked against.
        extensions: Straight road added beyond the surveyed one.
        ngsim: Where NGSIM's lanes lie, for a ramp of that data set.
        sources: Where each fact comes from, in words.
    """

    title: str
    net: str
    described: bool = False
    main: list[str] = Field(min_length=2)
    host_lane: list[int]
    ramp: list[str] = Field(min_length=1)
    merging_lane: list[int]
    gore: str
    merging_point: float = Field(ge=0.0, le=1e5)
    speed_limit: SpeedLimit
    lengths: dict[str, PositiveFloat] = Field(default_factory=dict)
    extensions: Extensions = Extensions()
    ngsim: NgsimMapping | None = None
    sources: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_story(self) -> "RampFile":
        if len(self.host_lane) != len(self.main):
            raise ValueError("host_lane needs one lane index per edge of main")
        if len(self.merging_lane) != len(self.ramp):
            raise ValueError("merging_lane needs one lane index per edge of ramp")
        if self.gore not in self.main[1:]:
            raise ValueError(f"gore must be an edge of main after the first: one of {', '.join(self.main[1:])}")
        for key, edges in (("main", self.main), ("ramp", self.ramp)):
            if len(set(edges)) < len(edges):
                raise ValueError(f"{key} names an edge twice: stations along it would not be unique")
        shared = [edge for edge in self.ramp if edge in self.main]
        start = self.main.index(self.gore)
        if shared != self.ramp[len(self.ramp) - len(shared) :] or shared != self.main[start : start + len(shared)]:
            raise ValueError("edges that ramp shares with main must be its last ones and start with gore")
        if len(shared) == len(self.ramp):
            raise ValueError("ramp needs an edge of its own before the gore")
        return self


def read_ramp_file(folder: Path) -> RampFile:
    """Read and check `ramp.toml` in a folder.

    Raises:
        UserError: The file is missing, is not TOML, or a key in it is wrong; the line names file and key.
    """
    return read_toml(folder / FILE_NAME, RampFile, "ramp")

"""Where a scenario's encounters come from: the kinds of the table `[encounters]` in a scenario file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    model_validator,
)

from merge_cosim.core.units import MOST_SPEED
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.simulation.worlds.meetings import Attention
from merge_cosim.sumo.demand import Demand

MOST_CASES = 10_000_000
"""Most cases of a grid: more is a slip in a step or an end."""


class Strict(BaseModel):
    """A part of a scenario file: a misspelt key is refused, and so is a number that is none."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True, allow_inf_nan=False)


def steps_between(first: float, last: float, step: float) -> int:
    """How many whole steps fit between two values, with a grain of tolerance for rounding."""
    return math.floor((last - first) / step + 1e-9)


class Range(Strict):
    """An interval.

    Attributes:
        first: Its lower end.
        last: Its upper end.
    """

    first: float = Field(alias="from")
    last: float = Field(alias="to")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.last < self.first:
            raise ValueError(f"'to' is below 'from' ({self.last:g} < {self.first:g})")
        return self


class Span(Range):
    """Evenly spaced values: `from`, and so on in steps as far as `to`, which is included where a step meets it."""

    step: PositiveFloat

    def values(self) -> list[float]:
        """All values, in order."""
        return [self.first + i * self.step for i in range(steps_between(self.first, self.last, self.step) + 1)]


R = TypeVar("R", bound=Range)


def _forwards(speeds: R) -> R:
    if speeds.first < 0:
        raise ValueError("a speed must not be negative")
    if speeds.last > MOST_SPEED:
        raise ValueError(f"a speed must be at most {MOST_SPEED:g} m/s")
    return speeds


Speeds = AfterValidator(_forwards)


class Grid(Strict):
    """Every combination of initial states (Designed Test II).

    Attributes:
        merging_station: The merging car's initial station [m].
        host_offset: The host's initial station minus the merging car's [m]; positive is ahead.
        host_speed: The host's initial speeds [m/s], none negative.
        merging_speed: The merging car's initial speeds [m/s], none negative.
        length: Length of both cars [m].
    """

    kind: Literal["grid"]
    merging_station: Annotated[float, Field(lt=0)] = -90.0
    host_offset: Span
    host_speed: Annotated[Span, Speeds]
    merging_speed: Annotated[Span, Speeds]
    length: PositiveFloat = 5.0

    @model_validator(mode="after")
    def _not_endless(self) -> Self:
        spans = (self.host_offset, self.host_speed, self.merging_speed)
        if math.prod((span.last - span.first) / span.step + 1.0 for span in spans) > MOST_CASES:
            raise ValueError(f"a grid of more than {MOST_CASES:,} cases; take longer steps")
        return self


class Random(Strict):
    """Initial states drawn at random, each uniform in its range; as many as asked for.

    The first cases of a larger count are the cases of a smaller one.

    Attributes:
        count: Number of cases, at most ten million: their names have seven digits.
        seed: Seed of the draw.
        merging_station: The merging car's initial station [m].
        host_offset: The host's initial station minus the merging car's [m]; positive is ahead.
        host_speed: The host's initial speed [m/s], not negative.
        merging_speed: The merging car's initial speed [m/s], not negative.
        length: Length of both cars [m].
    """

    kind: Literal["random"]
    count: Annotated[int, Field(gt=0, le=10_000_000)]
    seed: NonNegativeInt = 0
    merging_station: Annotated[float, Field(lt=0)] = -90.0
    host_offset: Range
    host_speed: Annotated[Range, Speeds]
    merging_speed: Annotated[Range, Speeds]
    length: PositiveFloat = 5.0


class Table(Strict):
    """Initial states given by the user: a row per case, with the columns of `Encounters.from_frame`.

    Attributes:
        file: CSV or Parquet file; None where a Python program hands the encounters over.
    """

    kind: Literal["table"]
    file: Path | None = None


class Pairs(Strict):
    """Logged pairs, or those of the surrogate.

    Attributes:
        sites: Which part of which site: `train`, `test` or `all`. A site is the name of a shipped ramp, or the path of
            a ramp's folder with a `site.toml`.
        split: `car`: all pairs of a merging car are on one side; `pair`: as the papers split.
        fraction: Share to train on.
        seed: Seed of the split.
        merge_point: `car`: station 0 is each logged lane change; `site`: the site's median, which shows an estimator
            nothing about the future.
        rules: How cars become pairs; what is not set is as the site has it.
    """

    kind: Literal["pairs"]
    sites: dict[str, Literal["train", "test", "all"]]
    split: Literal["car", "pair"] = "car"
    fraction: Annotated[float, Field(gt=0, lt=1)] = 1 / 3
    seed: int = 0
    merge_point: Literal["car", "site"] = "car"
    rules: PairRules = PairRules()


class ByArrival(Strict):
    """Seeded random initial states (Designed Test III); a case's state depends only on its number and the seed.

    Both cars start within the same spans of way and speed. The merging car's state is uniform over them. The difference
    of the times to arrival, T_m - T_h, is uniform from -`max_lead` to `max_lead`, and the host's speed is uniform over
    what then leaves its way within the span; a merging car's state that no host can match is drawn again.

    Attributes:
        count: Number of cases.
        seed: Seed of the states.
        nearest, farthest: Ways to the merging point [m].
        slowest, fastest: Speeds [m/s].
        max_lead: Largest difference of the times to arrival [s].
        length: Length of both cars [m].
    """

    kind: Literal["drawn"]
    count: PositiveInt = 5_000
    seed: int = 0
    nearest: PositiveFloat = 60.0
    farthest: PositiveFloat = 150.0
    slowest: PositiveFloat = 8.0
    fastest: PositiveFloat = 28.0
    max_lead: NonNegativeFloat = 2.0
    length: PositiveFloat = 5.0

    @model_validator(mode="after")
    def _spans(self) -> Self:
        if self.nearest >= self.farthest or self.slowest >= self.fastest:
            raise ValueError("nearest must be below farthest, and slowest below fastest")
        return self


def _id(value: object) -> object:
    """An id of SUMO, which may be a whole number: `--set` and TOML read that as one."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


class Routes(Strict):
    """Cars of an ordinary SUMO configuration, by the roles of their types.

    What stands below `file` is for scenes (`merging.model` = `sumo`), in which SUMO drives all cars but the hosts.

    Attributes:
        file: The `.sumocfg`.
        replications: Number of scenes, each with a SUMO seed of its own.
        seed: SUMO's seed of the first one.
        end: Where a scene ends [s]; 0 for the configuration's own end.
        host: A vehicle, flow or type that is a host without saying so.
        attention: Which merging cars a host attends to.
    """

    kind: Literal["routes"]
    file: Path
    replications: PositiveInt = 1
    seed: NonNegativeInt = 0
    end: NonNegativeFloat = 0.0
    host: Annotated[str, BeforeValidator(_id)] = ""
    attention: Attention = Attention()


class Traffic(Strict):
    """Living traffic on the ramp, made from a few numbers and driven by SUMO's own models.

    Attributes:
        replications: Number of scenes, each with a SUMO seed of its own.
        seed: SUMO's seed of the first one.
        demand: The traffic: how many cars, and SUMO's models.
        attention: Which merging cars a host attends to.
    """

    kind: Literal["traffic"]
    replications: PositiveInt = 4
    seed: NonNegativeInt = 0
    demand: Demand = Demand()
    attention: Attention = Attention()

    @property
    def host(self) -> str:
        """No host is named: the types of all hosts carry the role."""
        return ""

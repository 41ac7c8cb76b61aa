"""Encounters: one host and one merging car at one ramp, held as arrays over many encounters."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from merge_cosim.core.units import AnyArray, BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd

NEVER = 1 << 30
"""A cycle that is never reached."""


class Intention(IntEnum):
    """What the merging driver intends; as a label also what the driver did in the log."""

    UNKNOWN = -1
    YIELD = 0
    NOT_YIELD = 1


@dataclass(frozen=True)
class Ragged:
    """Arrays of different lengths laid end to end.

    Attributes:
        values: All entries, shape (total,).
        offsets: Row `i` is `values[offsets[i]:offsets[i + 1]]`, shape (n + 1,).
    """

    values: FloatArray
    offsets: IntArray

    @classmethod
    def of(cls, rows: Sequence[FloatArray]) -> Ragged:
        """Lay `rows` end to end."""
        offsets = np.concatenate([[0], np.cumsum([len(row) for row in rows], dtype=np.int64)]).astype(np.int64)
        values = np.concatenate(rows) if len(rows) else np.empty(0)
        return cls(np.asarray(values, dtype=np.float64), offsets)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, row: int) -> FloatArray:
        return self.values[self.offsets[row] : self.offsets[row + 1]]

    @property
    def lengths(self) -> IntArray:
        """Length of each row, shape (n,)."""
        return np.diff(self.offsets)

    def take(self, rows: IntArray) -> Ragged:
        """Return the chosen rows, in that order."""
        return Ragged.of([self[int(row)] for row in rows])

    @staticmethod
    def concatenate(parts: Sequence[Ragged]) -> Ragged:
        """Join ragged arrays row after row."""
        return Ragged.of([part[row] for part in parts for row in range(len(part))])


@dataclass(frozen=True)
class ReplayLog:
    """What was logged of each encounter, at 10 Hz from the window's start (cycle 0) on.

    Attributes:
        merging_station: The merging car's station [m] (smoothed, 0 at its lane change), to the end of its log.
        merging_speed: Its speed as an estimator may observe it [m/s] (causally filtered or raw), same lengths.
        host_station: The human host's station [m] (smoothed), to the end of its log.
        change_cycle: Cycle of the merging car's lane change, shape (n,).
        score_until: Last cycle that may be scored, because a logged car leaves the host lane after it; `NEVER` where
            a log ends in the host lane (then the merging car is continued at constant speed). Shape (n,).
        host_speed: The human host's speed as an estimator may observe it [m/s], lengths of `host_station`; None where
            it is not known.
    """

    merging_station: Ragged
    merging_speed: Ragged
    host_station: Ragged
    change_cycle: IntArray
    score_until: IntArray
    host_speed: Ragged | None = None

    def take(self, rows: IntArray) -> ReplayLog:
        """Return the chosen encounters' logs."""
        return ReplayLog(
            self.merging_station.take(rows),
            self.merging_speed.take(rows),
            self.host_station.take(rows),
            self.change_cycle[rows],
            self.score_until[rows],
            None if self.host_speed is None else self.host_speed.take(rows),
        )

    @staticmethod
    def concatenate(logs: Sequence[ReplayLog]) -> ReplayLog:
        """Join batches of logs."""
        speeds = [log.host_speed for log in logs if log.host_speed is not None]
        return ReplayLog(
            Ragged.concatenate([log.merging_station for log in logs]),
            Ragged.concatenate([log.merging_speed for log in logs]),
            Ragged.concatenate([log.host_station for log in logs]),
            np.concatenate([log.change_cycle for log in logs]),
            np.concatenate([log.score_until for log in logs]),
            Ragged.concatenate(speeds) if len(speeds) == len(logs) else None,
        )

    def swapped(self) -> ReplayLog:
        """The same logs with the two cars in each other's place.

        Raises:
            ValueError: The observable speed of the logged host is not known.
        """
        if self.host_speed is None:
            raise ValueError("these logs have no observable speed of the host")
        return replace(
            self,
            merging_station=self.host_station,
            merging_speed=self.host_speed,
            host_station=self.merging_station,
            host_speed=self.merging_speed,
        )


@dataclass(frozen=True)
class Encounters:
    """A batch of encounters; every array has shape (n,).

    Station [m]: front bumper along the car's own path, 0 at the merging point, negative upstream.

    Attributes:
        case: Name of each encounter, unique within its source (str).
        site: Site of each encounter, such as `us101`; `designed` where there is none (str).
        source: `ngsim`, `surrogate`, `designed` (a fixed grid, route files) or `random` (a sample) (str).
        car: Key of the merging car (`site/recording/vehicle/part`), by which data are split; empty if designed (str).
        host_station, host_speed, host_length: The host's initial state [m, m/s, m].
        merging_station, merging_speed, merging_length: The merging car's initial state.
        merge_position: Where station 0 lies, in metres along the main road past the ramp's gore.
        label: The order in the log, or the scripted intention (`Intention`); UNKNOWN where there is neither.
        smoothed_source: The source's positions were smoothed before they were published.
        length_missing: A car's length was not logged and 5 m stands for it.
        log: The logged trajectories, or None.
    """

    case: AnyArray
    site: AnyArray
    source: AnyArray
    car: AnyArray
    host_station: FloatArray
    host_speed: FloatArray
    host_length: FloatArray
    merging_station: FloatArray
    merging_speed: FloatArray
    merging_length: FloatArray
    merge_position: FloatArray
    label: IntArray
    smoothed_source: BoolArray
    length_missing: BoolArray
    log: ReplayLog | None = None

    @classmethod
    def unlogged(cls, case: AnyArray, site: str, source: str, **given: FloatArray | float) -> Encounters:
        """Encounters with neither log nor label, merging at the gore unless `merge_position` is given.

        Args:
            case: Their names, shape (n,).
            site: Of all of them.
            source: Of all of them.
            **given: The initial states and lengths, and other attributes that are not the default;
                a number is the value of all encounters.
        """
        usual = {"merge_position": 0.0, "label": int(Intention.UNKNOWN)}
        flags = {"smoothed_source": False, "length_missing": False}
        texts = {"site": site, "source": source, "car": ""}
        every: dict[str, FloatArray | float | str] = {**texts, **usual, **flags, **given}
        return cls(case, **{name: np.broadcast_to(value, len(case)) for name, value in every.items()}, log=None)

    @classmethod
    def from_frame(cls, frame: pd.DataFrame, *, sample: bool = False) -> Encounters:
        """Encounters from initial states of one's own, to be handed to a sweep.

        Example:
            >>> import pandas as pd
            >>> states = {"host_station": [-80.0], "host_speed": 20.0, "merging_station": -90.0, "merging_speed": 18.0}
            >>> len(Encounters.from_frame(pd.DataFrame(states)))
            1

        Args:
            frame: A row per case. Needed columns: `host_station`, `merging_station` [m], front bumpers along each
                car's own path, 0 at the merging point and negative upstream; `host_speed`, `merging_speed` [m/s].
                Optional: `case`, the names (`c0`, `c1`, ... if absent); `host_length`, `merging_length` [m] (5 m);
                `merge_position`, where station 0 lies in metres along the main road past the ramp's gore (0).
            sample: The states are a random sample, so that failure rates get confidence intervals.

        Raises:
            UserError: A column is missing or unknown, or a value is out of range.
        """
        from merge_cosim.core.frames import states_of

        case, states = states_of(frame)
        return cls.unlogged(case, "designed", "random" if sample else "designed", **states)

    def __len__(self) -> int:
        return len(self.case)

    @cached_property
    def start(self) -> FloatArray:
        """Stations of host and merging car, then their speeds, then their lengths, shape (6, n) [m, m/s, m]."""
        states = (self.host_station, self.merging_station, self.host_speed, self.merging_speed)
        return np.array([*states, self.host_length, self.merging_length])

    def take(self, rows: IntArray) -> Encounters:
        """Return the chosen encounters, in that order."""
        arrays = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "log"}
        return replace(self, **arrays, log=None if self.log is None else self.log.take(rows))

    def part(self, first: int, last: int) -> Encounters:
        """Return the encounters `first` to `last - 1`, as views where possible."""
        arrays = {f.name: getattr(self, f.name)[first:last] for f in fields(self) if f.name != "log"}
        return replace(self, **arrays, log=None if self.log is None else self.log.take(np.arange(first, last)))

    def swapped(self) -> Encounters:
        """The same encounters with the two cars in each other's place: the host is the car from the ramp.

        The intention is that of the car on the main road: the other one's opposite.
        """
        opposite = np.array([Intention.NOT_YIELD, Intention.YIELD, Intention.UNKNOWN], dtype=np.int64)
        return replace(
            self,
            host_station=self.merging_station,
            host_speed=self.merging_speed,
            host_length=self.merging_length,
            merging_station=self.host_station,
            merging_speed=self.host_speed,
            merging_length=self.host_length,
            label=opposite[self.label],
            log=None if self.log is None else self.log.swapped(),
        )

    @cached_property
    def digest(self) -> str:
        """A short hash of all that the encounters hold."""
        values = [getattr(self, f.name) for f in fields(self)]
        if self.log is not None:
            values += [getattr(self.log, f.name) for f in fields(self.log)]
        held = hashlib.sha256()
        for value in values:
            for array in (value.values, value.offsets) if isinstance(value, Ragged) else (value,):
                if isinstance(array, np.ndarray):
                    held.update("\0".join(array.tolist()).encode() if array.dtype.kind in "UO" else array.tobytes())
        return held.hexdigest()[:16]

    @staticmethod
    def concatenate(parts: Sequence[Encounters]) -> Encounters:
        """Join batches; they carry logs either all or none."""
        arrays = {
            f.name: np.concatenate([getattr(part, f.name) for part in parts])
            for f in fields(Encounters)
            if f.name != "log"
        }
        logs = [part.log for part in parts if part.log is not None]
        log = ReplayLog.concatenate(logs) if len(logs) == len(parts) else None
        return Encounters(**arrays, log=log)

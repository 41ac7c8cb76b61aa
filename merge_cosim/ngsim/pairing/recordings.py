"""Scenes: all logged cars of one recording together, at their logged places.

Positions are smoothed and frames counted as for the pairs, so that host and merging car of an encounter have in their
scene exactly the encounter's stations.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.units import AnyArray, BoolArray, FloatArray, IntArray
from merge_cosim.ngsim.data import episode_files, load_trajectories
from merge_cosim.ngsim.pairing.episodes import episode_tracks
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.tracks import Tracks, build_tracks
from merge_cosim.ngsim.sites import Site


@dataclass(frozen=True)
class LoggedScene:
    """The cars of one recording; row `offsets[i] + k` is car `i` in cycle `enters[i] + k`.

    A car whose log has a gap is several cars here, one for each gap-free part of it.

    Attributes:
        site: Name of the site.
        host_lane: Number of its host lane.
        recording: Name of the recording.
        car: Name of each car, `vehicle.part`, shape (n,).
        vehicle: Its number in the recording, shape (n,).
        length: Its length [m], shape (n,).
        length_missing: No length was logged, and the default stands for it, shape (n,).
        enters: First cycle of each car; the earliest is 0, shape (n,).
        offsets: Where each car's rows start, shape (n + 1,).
        x: Smoothed position of the front bumper [m past the gore], which never decreases, shape (rows,).
        lane: The recording's lane number, flicker removed, shape (rows,); see `Tracks.lane`.
    """

    site: str
    host_lane: int
    recording: str
    car: AnyArray
    vehicle: IntArray
    length: FloatArray
    length_missing: BoolArray
    enters: IntArray
    offsets: IntArray
    x: FloatArray
    lane: IntArray

    def __post_init__(self) -> None:
        back = np.diff(self.x) < 0
        back[self.offsets[1:-1] - 1] = False
        if back.any():
            raise ValueError(f"scene {self.recording}: a car runs backwards in row {int(np.argmax(back)) + 1}")

    def __len__(self) -> int:
        return len(self.car)

    @property
    def last(self) -> IntArray:
        """Last cycle of each car, shape (n,)."""
        return self.enters + np.diff(self.offsets) - 1

    @property
    def cycles(self) -> int:
        """Cycles from the first row to the last."""
        return int(self.last.max(initial=-1)) + 1

    def row(self, car: IntArray, cycle: int | IntArray) -> IntArray:
        """Rows of cars at a cycle, in which they must be logged."""
        return self.offsets[car] + cycle - self.enters[car]

    def present(self, cycle: int) -> IntArray:
        """The cars that are logged in a cycle."""
        return np.flatnonzero((self.enters <= cycle) & (cycle <= self.last))

    @cached_property
    def digest(self) -> str:
        """A short hash of all cars' ways."""
        held = hashlib.sha256()
        for values in (self.enters, self.offsets, self.length, self.x, self.lane):
            held.update(np.ascontiguousarray(values).tobytes())
        return held.hexdigest()[:16]

    def index(self, name: str) -> int:
        """Number of a car by its name.

        Raises:
            KeyError: There is none of this name.
        """
        found = np.flatnonzero(self.car == name)
        if not len(found):
            raise KeyError(f"scene {self.recording}: no car {name!r}")
        return int(found[0])


@dataclass(frozen=True)
class PairInScene:
    """Where an encounter lies in a scene.

    Attributes:
        host, merging: Names of its cars.
        start: The scene's cycle that is the encounter's cycle 0.
    """

    host: str
    merging: str
    start: int


def scenes_of(tracks: Tracks, site: Site, rules: PairRules) -> dict[str, LoggedScene]:
    """Cut tracks into one scene for each recording, by its name."""
    scenes = {}
    lengths = np.diff(tracks.offsets)
    for recording in np.unique(tracks.recording.astype(str)).tolist():
        here = tracks.recording == recording
        rows = np.repeat(here, lengths)
        missing = ~(tracks.length[here] > 0)
        names = [f"{v}.{p}" for v, p in zip(tracks.vehicle[here], tracks.part[here], strict=True)]
        scenes[recording] = LoggedScene(
            site=site.name,
            host_lane=site.host_lane,
            recording=recording,
            car=np.array(names, dtype=object),
            vehicle=tracks.vehicle[here],
            length=np.where(missing, rules.default_length, tracks.length[here]),
            length_missing=missing,
            enters=tracks.first_frame[here] - tracks.first_frame[here].min(),
            offsets=np.append(0, np.cumsum(lengths[here])),
            x=tracks.y[rows] - site.gore_y,
            lane=tracks.lane[rows],
        )
    return scenes


def site_scenes(data: Path, site: Site, rules: PairRules | None = None) -> dict[str, LoggedScene]:
    """Return the scenes of a site's trajectories in a data folder (or file), by the names of their recordings.

    Raises:
        UserError: A file is damaged.
    """
    rules = (rules or PairRules()).over(site.pairs)
    table = load_trajectories(data, site)
    return {} if table is None else scenes_of(build_tracks(table, site, rules, everywhere=True), site, rules)


def episode_scenes(data: Path, site: Site, rules: PairRules | None = None) -> dict[str, LoggedScene]:
    """Return a site's episodes as scenes: the merging car and its neighbours in the host lane, all without a length.

    Raises:
        UserError: A file is damaged.
    """
    rules, first = (rules or PairRules()).over(site.pairs), site.recording.episodes_from
    if first is None:
        return {}
    return {
        name: scene
        for path in episode_files(data)
        for name, scene in scenes_of(episode_tracks(path, site, rules, first), site, rules).items()
    }


def pair_in_scene(scenes: dict[str, LoggedScene], encounters: Encounters, row: int) -> tuple[LoggedScene, PairInScene]:
    """Find a logged encounter in the scene of its recording.

    Raises:
        KeyError: No scene holds it.
    """
    if encounters.log is None:
        raise ValueError("these encounters have no log")
    _, recording, vehicle, part = str(encounters.car[row]).rsplit("/", 3)
    merging, host = f"{vehicle}.{part}", str(encounters.case[row]).rpartition("-h")[2]
    scene = scenes[recording]
    scene.index(host)
    car = scene.index(merging)
    lane = scene.lane[scene.offsets[car] : scene.offsets[car + 1]]
    change = int(np.argmax(lane == scene.host_lane))
    start = int(scene.enters[car]) + change - int(encounters.log.change_cycle[row])
    return scene, PairInScene(host, merging, start)

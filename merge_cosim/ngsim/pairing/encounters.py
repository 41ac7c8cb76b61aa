"""All encounters of a site that a data folder holds: pairs of its trajectories, and its episodes beside them."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa

import merge_cosim
from merge_cosim.core.encounter import Encounters, Ragged
from merge_cosim.core.files import cache_folder, is_whole, keep
from merge_cosim.ngsim.data import READER_VERSION, episode_files, load_trajectories
from merge_cosim.ngsim.pairing.checks import without_failures
from merge_cosim.ngsim.pairing.episodes import read_episodes
from merge_cosim.ngsim.pairing.pairs import Paired, extract_pairs
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.stored import read_pairs, write_pairs
from merge_cosim.ngsim.sites import Site

PAIRS_VERSION = 3
"""Raised when the same trajectories would be paired differently, so that cached pairs are made anew."""

COMPLETE_CARS = 1_000
"""A recording with more cars than this is a complete 15-minute period of NGSIM (they have 1,790 to 2,169), no fragment
of one. It holds the merges of the episodes itself, so these are then left out."""

Source = Literal["ngsim", "recorded", "surrogate"]
"""Whether cars were filmed, by NGSIM or elsewhere, or simulated."""

CACHE_FROM = 0.2
"""Pairs that take longer than this [s] to extract are cached."""


def site_pairs(
    data: Path,
    site: Site,
    rules: PairRules | None = None,
    *,
    source: Source | None = None,
) -> Paired | None:
    """Return the pairs of `site` in a data folder, and what was rejected; None where the folder has nothing of it.

    Pairs whose logged host fails (see `checks`) are among the rejected.

    Args:
        data: Folder with trajectory files (or one such file).
        site: The site.
        rules: The thresholds; those that are not set are the site's. None for the site's.
        source: What the folder holds; None for the site's own recordings. The surrogate's files name it themselves.

    Raises:
        UserError: A file is damaged.
    """
    rules = (rules or PairRules()).over(site.pairs)
    source = source or site.source
    versions = merge_cosim.__version__, str(READER_VERSION), str(PAIRS_VERSION)
    choices = (repr(site), source, repr(rules), str(COMPLETE_CARS), *versions)
    key = "|".join([*_identity(data), *choices])
    cached = cache_folder("encounters") / f"{site.name}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.parquet"
    if is_whole(cached):
        return read_pairs(cached)
    began = time.perf_counter()
    parts = list(_parts(data, site, rules, source))
    if not parts:
        return None
    paired = without_failures(Paired.concatenate(parts))
    if time.perf_counter() - began > CACHE_FROM:
        keep(cached, lambda file: write_pairs(paired, file))
    return paired


def site_encounters(
    data: Path,
    site: Site,
    rules: PairRules | None = None,
    *,
    source: Source | None = None,
) -> Encounters | None:
    """Return only the encounters of `site_pairs`; station 0 is each merging car's own lane change."""
    paired = site_pairs(data, site, rules, source=source)
    return None if paired is None else paired.encounters


def at_site_point(encounters: Encounters) -> Encounters:
    """Move station 0 of every encounter to the median place of its site's merges (each merging car counted once).

    Station 0 at the logged lane change shows an estimator where the driver is going to merge; this variant does not.
    The cycle of the lane change and the label stay. An encounter that starts with its merging car past that point is
    left out, since there is nothing to decide any more.
    """
    if encounters.log is None:
        raise ValueError("these encounters have no log")
    point = np.empty(len(encounters))
    for name in np.unique(encounters.site):
        here = encounters.site == name
        _, first = np.unique(encounters.car[here], return_index=True)
        point[here] = np.median(encounters.merge_position[here][first])
    shift = encounters.merge_position - point
    log = encounters.log
    moved = replace(
        encounters,
        host_station=encounters.host_station + shift,
        merging_station=encounters.merging_station + shift,
        merge_position=point,
        log=replace(
            log,
            merging_station=_shifted(log.merging_station, shift),
            host_station=_shifted(log.host_station, shift),
        ),
    )
    return moved.take(np.flatnonzero(moved.merging_station < 0))


def _parts(data: Path, site: Site, rules: PairRules, source: Source) -> Iterator[Paired]:
    table = load_trajectories(data, site)
    if table is not None:
        yield extract_pairs(table, site, rules, source)
    episodes_from = site.recording.episodes_from
    if episodes_from is not None and not (table is not None and _most_cars(table) > COMPLETE_CARS):
        for path in episode_files(data):
            yield read_episodes(path, site, rules, episodes_from)


def _most_cars(table: pa.Table) -> int:
    """Largest number of cars in one recording."""
    cars = table.group_by("recording").aggregate([("vehicle_id", "count_distinct")])
    return max(cars["vehicle_id_count_distinct"].to_pylist(), default=0)


def _identity(data: Path) -> Iterator[str]:
    """Path, size and time of every file, from which follows whether a cached result still holds."""
    for path in sorted(data.rglob("*")) if data.is_dir() else [data]:
        if path.is_file():
            state = path.stat()
            yield f"{path.resolve()}:{state.st_size}:{state.st_mtime_ns}"


def _shifted(stations: Ragged, shift: np.ndarray) -> Ragged:
    return Ragged(stations.values + np.repeat(shift, stations.lengths), stations.offsets)

"""The data sets in numbers: the papers' Table I beside ours, and what the pairing rules left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT
from merge_cosim.ngsim.data import cached, episode_files
from merge_cosim.ngsim.pairing.checks import replay_logged_host
from merge_cosim.ngsim.pairing.encounters import site_pairs
from merge_cosim.ngsim.pairing.pairs import Paired
from merge_cosim.ngsim.sites import Site, shipped_sites


@dataclass(frozen=True)
class Published:
    """A row of the published data-set table (Dong, Dolan, Litkouhi 2017, Table I)."""

    pairs: int
    merge_distance_m: float
    speed_m_s: float


PUBLISHED = {"us101": Published(354, 90.4, 12.4), "i80": Published(452, 110.8, 14.2)}
"""Published figures by site."""


@dataclass(frozen=True)
class Summary:
    """One site's encounters in numbers; NaN where there is no pair.

    Attributes:
        site, source: Site and source of the encounters.
        pairs, cars: Pairs, and merging cars among them.
        merging_cars: Merging cars seen, paired or not.
        merge_distance_m: Mean distance of the merging cars from the start of the window to the lane change [m].
        speed_m_s: Space-mean speed: total distance / total time of both cars of each pair within its window [m/s].
        yielding: Share of pairs in which the host passed first.
        window_s: Shortest, median and longest window [s], None if there is no pair.
        complete, cut, extended: Pairs whose logs can be scored to the end; whose scoring ends early, because a logged
            car leaves the host lane; with a log that is continued at constant speed.
        smoothed_source, length_missing: Pairs with already smoothed positions; with a car of unknown length.
        host_past_start: Pairs whose host is past the merging point when the window starts.
        rejected: Reason -> how many (see `pairs.Paired`).
        logged_host_failures: Pairs that were excluded because the logged host fails in the replay.
        published: The paper's figures for this site.
    """

    site: str
    source: str
    pairs: int
    cars: int
    merging_cars: int
    merge_distance_m: float
    speed_m_s: float
    yielding: float
    window_s: tuple[float, float, float] | None
    complete: int
    cut: int
    extended: int
    smoothed_source: int
    length_missing: int
    host_past_start: int
    rejected: dict[str, int]
    logged_host_failures: tuple[str, ...]
    published: Published | None

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: None instead of NaN."""
        values = asdict(self)
        return {name: None if isinstance(value, float) and np.isnan(value) else value for name, value in values.items()}


def summarise(paired: Paired, site: str, source: str = "ngsim") -> Summary:
    """Compute a site's numbers."""
    e, log = paired.encounters, paired.encounters.log
    if log is None:
        raise ValueError("these encounters have no log")
    outcome = replay_logged_host(e)
    change = log.change_cycle
    rows = range(len(e))
    merging = np.array([log.merging_station[i][change[i]] for i in rows]) - e.merging_station
    host = np.array([log.host_station[i][change[i]] for i in rows]) - e.host_station
    windows = change * DT
    return Summary(
        site=site,
        source=source,
        pairs=len(e),
        cars=len(np.unique(e.car)),
        merging_cars=paired.merging_cars,
        merge_distance_m=_ratio(merging.sum(), len(e)),
        speed_m_s=_ratio(merging.sum() + host.sum(), 2 * windows.sum()),
        yielding=_ratio(float(np.sum(e.label == Intention.YIELD)), len(e)),
        window_s=tuple(np.quantile(windows, [0, 0.5, 1]).tolist()) if len(e) else None,
        complete=int(outcome.complete.sum()),
        cut=int(outcome.cut.sum()),
        extended=int(outcome.extended.sum()),
        smoothed_source=int(e.smoothed_source.sum()),
        length_missing=int(e.length_missing.sum()),
        host_past_start=int((e.host_station >= 0).sum()),
        rejected={reason: len(names) for reason, names in paired.rejected.items()},
        logged_host_failures=paired.rejected.get("logged_host_fails", ()),
        published=PUBLISHED.get(site),
    )


def summarise_folder(data: Path, sites: Sequence[Site] = ()) -> list[Summary]:
    """Compute the numbers of every site that a data folder (or file) holds; of the shipped ones, if none is given.

    Raises:
        UserError: It does not exist, a file is damaged, or there is nothing of these sites.
    """
    if not data.exists():
        raise UserError(f"{data}: no such folder or file")
    sites = sites or _sites_in(data)
    found = [(each, site_pairs(data, each)) for each in sites]
    summaries = [summarise(paired, each.name, _source(paired, each)) for each, paired in found if paired is not None]
    if not summaries:
        names = " or ".join(each.name for each in sites)
        raise UserError(f"{data}: no trajectories of {names} that could make pairs; put their files there")
    return summaries


def _source(paired: Paired, site: Site) -> str:
    """What the pairs say of themselves; the site's own source where there is none."""
    return " and ".join(dict.fromkeys(paired.encounters.source.tolist())) or site.source


def _sites_in(data: Path) -> Sequence[Site]:
    """The shipped sites that a file of trajectories holds; all of them for a folder or a file of episodes."""
    known = shipped_sites()
    if data.is_dir() or episode_files(data):
        return known
    reading = cached(data)
    return [each for each in known if each.name in reading.tables] or known


def _ratio(total: float, count: float) -> float:
    return float(total / count) if count else float("nan")

"""From a scenario to its encounters: the grid, or pairs of the user's NGSIM files or of the surrogate."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np

from merge_cosim.encounter import Encounters, Intention
from merge_cosim.errors import UserError
from merge_cosim.experiments.scenario import Grid, Pairs, Routes, Scenario
from merge_cosim.ngsim.data import data_files, episode_files, load_trajectories
from merge_cosim.ngsim.encounters import at_site_point, site_encounters
from merge_cosim.ngsim.sites import SITES, site
from merge_cosim.ngsim.split import split_cars
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.route_reader import read_sumocfg
from merge_cosim.traffic.surrogate import surrogate_folder

SourceChoice = Literal["ngsim", "surrogate"]


def load_encounters(scenario: Scenario, data: Path | None, source: SourceChoice | None) -> Encounters:
    """Return the scenario's encounters.

    Args:
        scenario: The scenario.
        data: Folder with NGSIM files, or None.
        source: Force real data or the surrogate; None takes real data for each site that has them.

    Raises:
        UserError: Real data are asked for and absent, or a file is damaged.
    """
    if isinstance(scenario.encounters, Grid):
        return _grid(scenario.encounters)
    if isinstance(scenario.encounters, Routes):
        return read_sumocfg(scenario.encounters.file)[1]
    parts = [
        _part(pairs_of_site(name, scenario.encounters, data, source), scenario.encounters, part)
        for name, part in scenario.encounters.sites.items()
    ]
    encounters = Encounters.concatenate(parts)
    if scenario.encounters.merge_point == "site":
        encounters = at_site_point(encounters)
    if scenario.is_replay:
        return encounters
    nothing = np.full(len(encounters), int(Intention.UNKNOWN))
    merging_point = np.full(len(encounters), Ramp.load(scenario.ramp).merging_point)
    return replace(encounters, log=None, label=nothing, merge_position=merging_point)


def _part(encounters: Encounters, pairs: Pairs, part: Literal["train", "test", "all"]) -> Encounters:
    if part == "all":
        return encounters
    train = split_cars(encounters, pairs.fraction, pairs.seed, pairs.split)
    return encounters.take(np.flatnonzero(train if part == "train" else ~train))


def pairs_of_site(name: str, pairs: Pairs, data: Path | None, source: SourceChoice | None) -> Encounters:
    """All pairs of one site, real or surrogate.

    Raises:
        UserError: Real data are asked for and absent, or the data folder holds nothing of any site, or a damaged file.
    """
    real = None if source == "surrogate" or data is None else site_encounters(data, site(name), pairs.rules)
    if real is not None and not len(real):
        real = None
    if real is None and source == "ngsim":
        where = data or "no data folder (give --data DIR or set MERGE_COSIM_DATA)"
        raise UserError(f"{where}: no {name} pairs in real NGSIM data; leave out --source ngsim to use the surrogate")
    if real is None and source is None and data is not None:
        _refuse_nothing(data)
    if real is None:
        folder = surrogate_folder(site(name))
        real = site_encounters(folder, site(name), pairs.rules, source="surrogate")
        assert real is not None
    return real


def _refuse_nothing(data: Path) -> None:
    """Refuse a folder that can stand for no site at all: who names one does not expect the surrogate."""
    if any(load_trajectories(data, one) is not None for one in SITES) or episode_files(data):
        return
    notes = "; ".join(f"{file.path.name}: {file.note}" for file in data_files(data) if file.note)
    raise UserError(
        f"{data}: no row of {' or '.join(one.name for one in SITES)} in any NGSIM file there"
        f"{f' ({notes})' if notes else ''}; leave it out, or add --source surrogate, to use the surrogate"
    )


def _grid(grid: Grid) -> Encounters:
    axes = (grid.host_offset.values(), grid.host_speed.values(), grid.merging_speed.values())
    offset, host_speed, merging_speed = (np.array(column) for column in zip(*product(*axes), strict=True))
    n = len(offset)
    cases = [f"d{d:+g}_h{h:g}_m{m:g}" for d, h, m in zip(offset, host_speed, merging_speed, strict=True)]
    return Encounters(
        case=np.array(cases),
        site=np.full(n, "designed"),
        source=np.full(n, "designed"),
        car=np.full(n, ""),
        host_station=grid.merging_station + offset,
        host_speed=host_speed,
        host_length=np.full(n, grid.length),
        merging_station=np.full(n, grid.merging_station),
        merging_speed=merging_speed,
        merging_length=np.full(n, grid.length),
        merge_position=np.zeros(n),
        label=np.full(n, int(Intention.UNKNOWN)),
        smoothed_source=np.zeros(n, dtype=bool),
        length_missing=np.zeros(n, dtype=bool),
    )

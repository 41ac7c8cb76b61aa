"""From a scenario to its encounters: a grid, random states, or pairs of the user's NGSIM files or of the surrogate."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.data import data_files, episode_files, load_trajectories
from merge_cosim.ngsim.pairing.encounters import at_site_point, site_encounters
from merge_cosim.ngsim.pairing.split import split_cars
from merge_cosim.ngsim.sites import Site, shipped_sites, site
from merge_cosim.ngsim.surrogate.surrogate import surrogate_folder
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scenarios.hidden import hidden_encounters
from merge_cosim.scenarios.random_states import RandomStates, designed_encounters
from merge_cosim.scenarios.scenario import Scenario
from merge_cosim.scenarios.sources import ByArrival, Grid, Pairs, Random, Routes, Table, Traffic
from merge_cosim.sumo.route_reader import read_sumocfg

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
    if isinstance(scenario.encounters, Random):
        return RandomStates.of(scenario.encounters).encounters()
    if isinstance(scenario.encounters, ByArrival):
        encounters = hidden_encounters(scenario.encounters)
        return replace(encounters, label=scenario.merging_car().intentions(encounters))
    if isinstance(scenario.encounters, Table):
        return _table(scenario.encounters, scenario.name)
    if isinstance(scenario.encounters, Routes):
        return read_sumocfg(scenario.encounters.file, scenario.host)[1]
    if isinstance(scenario.encounters, Traffic):
        raise UserError(f"scenario {scenario.name}: it is living traffic and has no encounters of its own")
    parts = [
        _part(pairs_of_site(name, scenario.encounters, data, source), scenario.encounters, part)
        for name, part in scenario.encounters.sites.items()
    ]
    encounters = Encounters.concatenate(parts)
    if scenario.encounters.merge_point == "site":
        encounters = at_site_point(encounters)
    if scenario.host == "ramp":
        encounters = encounters.swapped()
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
    there = site(name)
    real = None if source == "surrogate" or data is None else site_encounters(data, there, pairs.rules)
    if real is not None and source == "ngsim":
        real = real.take(np.flatnonzero(real.source != "surrogate"))
    if real is not None and not len(real):
        real = None
    if real is None and source == "ngsim":
        where = data or "no data folder (give --data DIR or set MERGE_COSIM_DATA)"
        raise UserError(f"{where}: no {there.name} pairs in real data; leave out --source ngsim to use the surrogate")
    if real is None and source is None and data is not None:
        _refuse_nothing(data, there)
    if real is None:
        real = site_encounters(surrogate_folder(there), there, pairs.rules, source="surrogate")
        assert real is not None
    return real


def _refuse_nothing(data: Path, wanted: Site) -> None:
    """Refuse a folder with data of no site: a user that names one does not expect the surrogate."""
    sites = list({one.name: one for one in (*shipped_sites(), wanted)}.values())
    if any(load_trajectories(data, one) is not None for one in sites) or episode_files(data):
        return
    notes = "; ".join(f"{file.path.name}: {file.note}" for file in data_files(data) if file.note)
    raise UserError(
        f"{data}: no row of {' or '.join(one.name for one in sites)} in any file there"
        f"{f' ({notes})' if notes else ''}; leave it out, or add --source surrogate, to use the surrogate"
    )


def _table(table: Table, scenario: str) -> Encounters:
    if table.file is None:
        raise UserError(f"scenario {scenario}: the key 'encounters.file' is missing")
    try:
        frame = (pd.read_parquet if table.file.suffix == ".parquet" else pd.read_csv)(table.file)
    except (OSError, ValueError) as error:  # pandas' and pyarrow's own are among them
        raise UserError(f"{table.file}: not a readable CSV or Parquet file ({error})") from None
    try:
        return Encounters.from_frame(frame)
    except UserError as error:
        raise UserError(f"{table.file}: {error}") from None


def _grid(grid: Grid) -> Encounters:
    axes = (grid.host_offset.values(), grid.host_speed.values(), grid.merging_speed.values())
    offset, host_speed, merging_speed = (np.array(column) for column in zip(*product(*axes), strict=True))
    cases = [f"d{d:+g}_h{h:g}_m{m:g}" for d, h, m in zip(offset, host_speed, merging_speed, strict=True)]
    return designed_encounters(grid, cases, "designed", offset, host_speed, merging_speed)

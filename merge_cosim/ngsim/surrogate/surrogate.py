"""The surrogate: SUMO's own traffic at an NGSIM site, in NGSIM's format: everything works without a download."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import cache_folder, from_cache, refuse_file
from merge_cosim.core.programs import end_programs
from merge_cosim.ngsim.sites import Site
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.ngsim.surrogate.ngsim_format import ngsim_rows
from merge_cosim.ngsim.surrogate.recipe import RECIPES, Recipe
from merge_cosim.ngsim.surrogate.sumo_run import simulate
from merge_cosim.ramps.definition import FILE_NAME
from merge_cosim.ramps.ramp import Ramp

SURROGATE_VERSION = 2
"""Raised when the same recipe would give other files, so that cached ones are made anew."""

PROCESSES = 2
"""Recordings that are simulated at the same time."""


def surrogate_folder(site: Site) -> Path:
    """Return the folder with the synthetic trajectories of `site`; made first, with SUMO, if they are not cached.

    Raises:
        UserError: There is no surrogate of this site.
    """
    if site.name not in RECIPES:
        names = " and ".join(RECIPES)
        raise UserError(
            f"site {site.name}: there is no surrogate of it (only of {names}); give its data with --data DIR"
        )
    return cached_surrogate(RECIPES[site.name])


def cached_surrogate(recipe: Recipe) -> Path:
    """Return the folder that holds what `generate` makes of a recipe, from the cache if it was made before."""
    ramp = Ramp.load(recipe.site)
    folder = cache_folder("surrogate") / f"{recipe.site}-{_key(recipe, ramp)}"

    def make(made: Path) -> None:
        made.mkdir()
        generate(recipe, ramp, made / f"{recipe.site}-surrogate.parquet")

    return from_cache(folder, make)


def generate(recipe: Recipe, ramp: Ramp, target: Path) -> None:
    """Simulate a recipe and write it as one NGSIM file, the same bytes every time.

    Args:
        recipe: The traffic; each of its seeds is one recording.
        ramp: Where it drives.
        target: The Parquet file to write, in NGSIM's columns and units.

    Raises:
        UserError: SUMO fails.
    """
    site = find_site(recipe.site)
    assert ramp.ngsim is not None
    end = site.length - ramp.ngsim.gore_local_y

    def record(recording: int) -> pa.Table:
        with tempfile.TemporaryDirectory() as scratch:
            run = simulate(recipe, ramp, recipe.seeds[recording], end, Path(scratch))
            return ngsim_rows(run, recipe, ramp, site, recording)

    with ThreadPoolExecutor(PROCESSES) as pool:
        try:
            table = pa.concat_tables(pool.map(record, range(len(recipe.seeds))))
        except BaseException:  # an interrupt, too: the pool waits for its threads, and they for SUMO
            end_programs()
            raise
    raw = pa.array(np.zeros(table.num_rows, dtype=bool))
    source = pa.array([f"surrogate: SUMO {version('eclipse-sumo')}"] * table.num_rows)
    table = table.append_column("source", source).append_column("smoothed", raw)
    pq.write_table(table, target, compression="zstd")


def export(site: Site, out: Path) -> Path:
    """Copy the file of `surrogate_folder` to the folder `out`, made where it is missing, and return the copy.

    Raises:
        UserError: The folder cannot be written to.
    """
    refuse_file(out)
    (made,) = surrogate_folder(site).iterdir()
    try:
        out.mkdir(parents=True, exist_ok=True)
        return Path(shutil.copy(made, out))
    except OSError as error:
        raise UserError(f"{out}: cannot be written to ({error.strerror}); name another folder with --out") from None


def _key(recipe: Recipe, ramp: Ramp) -> str:
    """A short hash of everything that the trajectories depend on."""
    facts = f"{recipe!r}|{version('eclipse-sumo')}|{SURROGATE_VERSION}"
    content = facts.encode() + ramp.net.read_bytes() + (ramp.net.parent / FILE_NAME).read_bytes()
    return hashlib.sha256(content).hexdigest()[:16]

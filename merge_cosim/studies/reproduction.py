"""All sweeps behind the papers' tables and figures, run one after the other into one folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from merge_cosim.ngsim.pairing.encounters import site_encounters
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.scenarios.encounters import SourceChoice
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.studies.training import train, train_ensemble
from merge_cosim.sweeps.sweep import SweepRequest, sweep

NODES = (1, 2, 4, 8, 13, 20, 26, 32, 39, 45, 52, 59, 66, 73, 80, 90, 100, 110, 120)
"""Numbers of speed nodes that are tried (Dong, Dolan, Litkouhi 2017, failure rate by number of nodes)."""
DESIGNED, PAIRS, NODE_SWEEP, MODEL_SWEEP = "designed", "pairs", "nodes", "models-swept"
SPLITS = 10
"""Models of the ensemble, each trained on another third of the merging cars."""
LEARNED = ("pgm", "pgm-symmetric", "pgm-g", "fg", "fg-gmm", "ipcb")
"""Methods that are run with each model of the ensemble, in Designed Test II."""
MODELS = "models"
"""Folder of the models that are trained on the way."""

Say = Callable[[int, int, str], None]
"""Called with the cases done, all cases and what is being run."""


@dataclass(frozen=True)
class Study:
    """One sweep of the reproduction.

    Attributes:
        kind: `designed` (no data), `pairs` (all tests that start from pairs), `nodes` (number of speed nodes) or
            `models-swept` (Designed Test II with each model of an ensemble, in the closed form).
        source: Where its pairs come from; `designed` where there are none. Sources are never mixed.
        request: The sweep.
    """

    kind: str
    source: str
    request: SweepRequest

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self.kind if self.kind == self.source else f"{self.kind}-{self.source}"


def reproduce(
    data: Path | None, out: Path, jobs: int, seed: int = 0, say: Say | None = None, world: WorldKind = "sumo"
) -> list[Study]:
    """Train a model per source, run every study into a folder of its own, and return the studies."""
    found = studies(data, out, jobs, seed, say, world)
    run(found, out, say)
    return found


def run(found: Sequence[Study], out: Path, say: Say | None = None) -> None:
    """Run studies into folders of their own; a finished one is not run again, an interrupted one goes on."""
    for number, study in enumerate(found, start=1):

        def of_study(done: int, total: int, what: str, lead: str = f"{number}/{len(found)} {study.name}") -> None:
            if say:
                say(done, total, f"{lead}: {what}")

        sweep(study.request, out / study.name, resume=True, overwrite=True, progress=of_study)


def studies(
    data: Path | None, out: Path, jobs: int, seed: int, say: Say | None = None, world: WorldKind = "sumo"
) -> list[Study]:
    """The sweeps to run: those without data, then those on the surrogate and those on real pairs, each apart."""
    base = SweepRequest((), data=data, jobs=jobs, seed=seed, world=world)
    found = [Study(DESIGNED, DESIGNED, replace(base, scenarios=("designed-2", "designed-3")))]
    for source, sites in _sites(data).items():
        if say:
            say(0, 1, f"training on us101 ({source})")
        model = out / MODELS / f"us101-{source}.json"
        train("us101", data, source, "car", seed, model)
        here = replace(base, source=source, model=str(model))
        tests = replace(here, scenarios=(*(f"{site}-replay" for site in sites), "designed-1"))
        if len(sites) < len(PARTS):  # designed-1 takes its initial states from the sites that there are
            tests = replace(tests, settings={"encounters.sites": {site: PARTS[site] for site in sites}})
        found.append(Study(PAIRS, source, tests))
        varied = [("pgm.nodes", NODES)]
        nodes = replace(here, scenarios=("us101-replay",), methods=("pgm",), variations=varied)
        found.append(Study(NODE_SWEEP, source, nodes))
        several = out / MODELS / f"{source}-splits"
        train_ensemble("us101", data, source, seed, several, splits=SPLITS)
        swept = replace(base, scenarios=("designed-2",), methods=LEARNED, model=str(several), world="closed-form")
        found.append(Study(MODEL_SWEEP, source, swept))
    return found


PARTS = {"us101": "test", "i80": "all"}
"""The papers' sites, and which part of each one's pairs is tested: the model is trained on the rest of US-101."""


def _sites(data: Path | None) -> dict[SourceChoice, list[str]]:
    """The sites that each source has pairs of; real ones only with US-101, which the model is trained on."""
    everywhere = list(PARTS)
    real = [name for name in everywhere if data and _has_pairs(name, data)]
    return {"surrogate": everywhere, "ngsim": real} if "us101" in real else {"surrogate": everywhere}


def _has_pairs(name: str, data: Path) -> bool:
    found = site_encounters(data, find_site(name))
    return found is not None and bool((found.source != "surrogate").any())

"""`merge_cosim.train`, `bounds`, `export` and `reproduce`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pandas as pd

from merge_cosim.api.progress import sweep_progress
from merge_cosim.api.request import ScenarioLike, request_of
from merge_cosim.api.results import Results
from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.data import find_data
from merge_cosim.scenarios.encounters import SourceChoice
from merge_cosim.scenarios.methods import MethodSpec
from merge_cosim.simulation.worlds.base import WorldKind


@dataclass(frozen=True, repr=False)
class Training:
    """A trained model and how it judges merging cars that it was not trained on.

    Attributes:
        model: The model; `merge_cosim.sweep` and `run` take it.
        path: Its file.
        report: Numbers of pairs and cars, `held_out`, `calibration` and `densities`, as in docs/models.md.
    """

    model: IntentionModel
    path: Path
    report: dict[str, Any]

    @property
    def held_out(self) -> pd.DataFrame:
        """How each estimator judges held-out merging cars, by distance to the merging point."""
        return pd.DataFrame(self.report["held_out"])

    def __repr__(self) -> str:
        return f"{self._title}\n{self.held_out.round(3).to_string(index=False)}"

    def _repr_html_(self) -> str:
        return f"<p>{self._title}</p>{self.held_out.round(3).to_html(index=False, border=0)}"

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        return {"text/plain": repr(self), "text/html": self._repr_html_()}

    @property
    def _title(self) -> str:
        pairs, cars, source = (self.report[name] for name in ("train_pairs", "train_cars", "source"))
        return f"Model {self.path}, trained on {pairs} pairs of {cars} cars ({source}); held-out merging cars:"


def train(
    out: str | Path,
    *,
    site: str | Path = "us101",
    data: str | Path | None = None,
    source: SourceChoice | None = None,
    split: Literal["car", "pair"] = "car",
    seed: int = 0,
    everything: bool = False,
) -> Training:
    """Learn speed transitions, times to arrival and the prior from one third of a site's pairs, and judge the rest.

    Example:
        >>> model = mc.train("models/mine.json", source="surrogate").model  # doctest: +SKIP
        >>> mc.sweep("us101-replay", "pgm", model=model)  # doctest: +SKIP

    Args:
        out: Model file to write (.json).
        site: A shipped ramp, or a folder with `site.toml`.
        data: Folder with trajectory files; else `$MERGE_COSIM_DATA`, else `./data`.
        source: `"ngsim"` or `"surrogate"`: force real data or the surrogate.
        split: What is kept together on one side of the split.
        seed: Seed of the split.
        everything: Learn from all pairs; then none is left to judge the model on.

    Raises:
        UserError: There are no such pairs, or too few of one intention, or `out` is no `.json`.
    """
    from merge_cosim.studies.training import train as train_model

    folder = find_data(data)
    report = train_model(str(site), folder, source, split, seed, Path(out), everything)
    return Training(IntentionModel.load(out), Path(out), report)


def train_ensemble(
    out: str | Path,
    *,
    site: str | Path = "us101",
    data: str | Path | None = None,
    source: SourceChoice | None = None,
    seed: int = 0,
    splits: int = 0,
    folds: int = 0,
) -> pd.DataFrame:
    """Train several models, so that what depends on the training cars can be seen.

    Example:
        >>> mc.train_ensemble("models/splits", splits=10, source="surrogate")  # doctest: +SKIP
        >>> mc.sweep("designed-2", "pgm", model="models/splits").ensemble()  # doctest: +SKIP

    Args:
        out: Folder of the model files; give it as `model` to `merge_cosim.sweep`.
        site: As in `train`.
        data: As in `train`.
        source: As in `train`.
        seed: Seed of the first split, or of the folds.
        splits: Number of models, each trained on another third of the merging cars.
        folds: Instead, number of parts of the merging cars; each model is trained on all parts but one, so that every
            pair is tested by the one model that has not seen its car (cross-fitting).

    Returns:
        One row per model: file, numbers of training pairs and cars.

    Raises:
        UserError: As in `train`; or not exactly one of `splits` and `folds` is given, or there are too few cars.
    """
    from merge_cosim.studies.training import train_ensemble as train_models

    folder = find_data(data)
    return pd.DataFrame(train_models(str(site), folder, source, seed, Path(out), splits, folds))


def bounds(
    scenario: str | Path,
    *,
    settings: Mapping[str, Any] | None = None,
    data: str | Path | None = None,
    source: SourceChoice | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Bound what any host could have done: cases without a way, and the smallest delays.

    Args:
        scenario: A scenario of two cars, or its file.
        settings: As in `merge_cosim.sweep`.
        data: As in `merge_cosim.sweep`.
        source: As in `merge_cosim.sweep`.

    Returns:
        One row per case, and their counts per site and source.

    Raises:
        UserError: It has more cars than two, or its data are absent.
    """
    from merge_cosim.studies.bounds import bounds_of

    folder = find_data(data)
    cases, counts = bounds_of(str(scenario), dict(settings or {}), folder, source)
    return cases, pd.DataFrame(counts)


def export(
    scenario: ScenarioLike,
    case: str,
    out: str | Path,
    *,
    commonroad: bool = False,
    method: MethodSpec | None = None,
    model: str | Path | IntentionModel | None = None,
    settings: Mapping[str, Any] | None = None,
    data: str | Path | None = None,
    source: SourceChoice | None = None,
    seed: int = 0,
) -> Path:
    """Write one case as ordinary SUMO files, or run it and write it as a CommonRoad scenario.

    Args:
        scenario: A scenario, as `merge_cosim.sweep` takes it.
        case: Name of the case.
        out: Folder to write to.
        commonroad: Write a CommonRoad scenario, with the host as its planning problem.
        method: With `commonroad`: the method that drives the host; `acc`, if not given.
        model: As in `merge_cosim.sweep`.
        settings: As in `merge_cosim.sweep`.
        data: As in `merge_cosim.sweep`.
        source: As in `merge_cosim.sweep`.
        seed: As in `merge_cosim.sweep`.

    Returns:
        The `.sumocfg`, or the CommonRoad file.

    Raises:
        UserError: There is no such case, or what is asked for does not fit.
    """
    from merge_cosim.sweeps.single import export_case, export_commonroad

    if method and not commonroad:
        raise UserError("--method: only with --commonroad; the SUMO files of a case are the same under all methods")
    request = request_of(
        scenario, [method or "acc"], model=model, settings=settings, data=data, source=source, seed=seed
    )
    return (export_commonroad if commonroad else export_case)(request, case, Path(out))


def reproduce(
    out: str | Path,
    *,
    data: str | Path | None = None,
    jobs: int | None = None,
    seed: int = 0,
    world: WorldKind = "sumo",
    progress: bool = True,
) -> tuple[Path, dict[str, Results]]:
    """Run every table and figure of the papers, ours beside theirs, into one HTML page; a second call goes on.

    Args:
        out: Folder for results, models, tables and the page.
        data: As in `merge_cosim.sweep`.
        jobs: As in `merge_cosim.sweep`.
        seed: As in `merge_cosim.sweep`.
        world: As in `merge_cosim.sweep`.
        progress: As in `merge_cosim.sweep`.

    Returns:
        The page, and the results of each sweep by its name.

    Raises:
        UserError: `out` is a file.
    """
    from merge_cosim.core.files import refuse_file
    from merge_cosim.studies.papers.page import write_reproduction
    from merge_cosim.studies.reproduction import reproduce as run_studies

    refuse_file(Path(out))
    folder = find_data(data)
    with sweep_progress(progress) as report:
        studies = run_studies(folder, Path(out), jobs or os.cpu_count() or 1, seed, report, world)
        page = write_reproduction(studies, Path(out), report)
    return page, {study.name: Results(Path(out) / study.name) for study in studies}

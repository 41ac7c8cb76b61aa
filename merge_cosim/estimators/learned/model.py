"""What is learned from data: counts and fitted densities in one small readable file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from merge_cosim.core.encounter import Intention
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.learned.gaussian import SpeedGaussian
from merge_cosim.estimators.learned.histogram import SPEED_BINS, TIME_BINS, ArrivalHistogram, SpeedHistogram
from merge_cosim.estimators.learned.mixture import SpeedMixture

SCHEMA = 2
MODELS = Path(__file__).parent / "models"
"""Where the models that come with the project lie."""


@dataclass(frozen=True)
class SpeedModel:
    """P(V_t | V_{t-lag}, I) for one lag, in three forms.

    Attributes:
        histogram: Counts of transitions, for PGM and FG.
        gaussian: One Gaussian per speed bin, for PGM-G.
        mixture: A mixture over both speeds, for FG-GMM.
    """

    histogram: SpeedHistogram
    gaussian: SpeedGaussian
    mixture: SpeedMixture

    @classmethod
    def fit(cls, before: FloatArray, now: FloatArray, label: IntArray) -> SpeedModel:
        """Fit all three to the same transitions.

        Args:
            before: Speeds [m/s], shape (n,).
            now: Speeds `lag` cycles later [m/s], shape (n,).
            label: Intention of each transition's driver, shape (n,).

        Raises:
            UserError: There are too few transitions of an intention.
        """
        data = before, now, label
        return cls(SpeedHistogram.fit(*data), SpeedGaussian.fit(*data), SpeedMixture.fit(*data))


@dataclass(frozen=True)
class IntentionModel:
    """What was learned from training pairs; index 0 is YIELD, index 1 NOT_YIELD.

    Attributes:
        name: Short name, shown in every result row that used it.
        site, source: Where the training pairs come from.
        trained_on: Keys of the training merging cars, sorted; a test must not contain them.
        settings: How the pairs were chosen and split, for the reader.
        pairs: Number of pairs per intention, shape (2,).
        merge_speed: Mean speed of the training merging cars at their lane change [m/s].
        speeds: Speed transitions by lag in cycles; see `speed`.
        arrivals: Times to arrival of both cars.
    """

    name: str
    site: str
    source: str
    trained_on: tuple[str, ...]
    settings: dict[str, Any]
    pairs: IntArray
    merge_speed: float
    speeds: dict[int, SpeedModel]
    arrivals: ArrivalHistogram

    @property
    def prior_log_odds(self) -> float:
        """`log P(N) - log P(Y)`, from the shares of the training pairs."""
        return float(np.log(self.pairs[Intention.NOT_YIELD]) - np.log(self.pairs[Intention.YIELD]))

    def speed(self, lag: int) -> SpeedModel:
        """Return the speed transitions over `lag` cycles.

        Raises:
            UserError: The model was not trained for this lag.
        """
        if lag not in self.speeds:
            raise UserError(f"model {self.name}: no transitions for transition_lag {lag} (has {sorted(self.speeds)})")
        return self.speeds[lag]

    def to_json(self) -> str:
        """The model as text, one entry per line, counts as sparse lists."""
        document = {
            "schema": SCHEMA,
            "name": self.name,
            "site": self.site,
            "source": self.source,
            "settings": self.settings,
            "pairs": _by_intention(self.pairs),
            "merge_speed": self.merge_speed,
            "transitions": {
                str(lag): {i.name: _sparse(speed.histogram.counts[i]) for i in _BOTH}
                for lag, speed in self.speeds.items()
            },
            "gaussians": {str(lag): _fields(speed.gaussian) for lag, speed in self.speeds.items()},
            "mixtures": {str(lag): _fields(speed.mixture) for lag, speed in self.speeds.items()},
            "arrivals": {i.name: _sparse(self.arrivals.shares[i].round(6)) for i in _BOTH},
            "trained_on": list(self.trained_on),
        }
        rows = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in document.items())
        return "{\n" + ",\n".join(rows) + "\n}\n"

    def save(self, file: Path) -> None:
        """Write the model's file."""
        file.write_text(self.to_json(), encoding="utf-8")

    @classmethod
    def load(cls, name: str | Path) -> IntentionModel:
        """Read a model file, or one of the project's own by name.

        Raises:
            UserError: There is no such file, or it is no model.
        """
        file = Path(name)
        if not file.is_file() and (MODELS / f"{name}.json").is_file():
            file = MODELS / f"{name}.json"
        if not file.is_file():
            own = ", ".join(sorted(path.stem for path in MODELS.glob("*.json")))
            raise UserError(f"{file}: no such model file (the project's own: {own}; make one with 'merge-cosim train')")
        try:
            document = json.loads(file.read_text(encoding="utf-8"))
            if document["schema"] != SCHEMA:
                raise UserError(f"{file}: model schema {document['schema']}, expected {SCHEMA}; train it again")
            model = cls(
                name=document["name"],
                site=document["site"],
                source=document["source"],
                trained_on=tuple(document["trained_on"]),
                settings=document["settings"],
                pairs=_stacked(document["pairs"]),
                merge_speed=float(document["merge_speed"]),
                speeds={int(lag): _speed_model(document, lag) for lag in document["transitions"]},
                arrivals=ArrivalHistogram(np.stack([_dense(document["arrivals"][i.name], TIME_BINS) for i in _BOTH])),
            )
            if not ((model.pairs > 0).all() and (model.arrivals.shares.sum(axis=(1, 2)) > 0).all()):
                raise ValueError("one intention has no pairs or no arrivals")
            return model
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise UserError(f"{file}: not a merge-cosim model ({error!r}); make one with 'merge-cosim train'") from None


def load_models(name: str | Path) -> list[IntentionModel]:
    """Read a model by file or name (see `IntentionModel.load`), or all model files of a folder, sorted by name.

    Raises:
        UserError: There is none, or one is no model.
    """
    folder = Path(name)
    if not folder.is_dir():
        return [IntentionModel.load(name)]
    files = sorted(folder.glob("*.json"))
    if not files:
        raise UserError(f"{folder}: holds no model file (*.json); make some with 'merge-cosim train --splits 10'")
    return [IntentionModel.load(file) for file in files]


MOST = 1e15
"""Most that a cell can hold: beyond it a 64-bit number is not exact."""
_BOTH = (Intention.YIELD, Intention.NOT_YIELD)


def _speed_model(document: dict[str, Any], lag: str) -> SpeedModel:
    counts = [_dense(document["transitions"][lag][i.name], SPEED_BINS) for i in _BOTH]
    if not all((both == both.round()).all() for both in counts):
        raise ValueError("a count of transitions is not whole")
    return SpeedModel(
        SpeedHistogram(np.stack(counts).astype(np.int64)),
        SpeedGaussian(**{name: _stacked(both) for name, both in document["gaussians"][lag].items()}),
        SpeedMixture(**{name: _stacked(both) for name, both in document["mixtures"][lag].items()}),
    )


def _fields(density: SpeedGaussian | SpeedMixture) -> dict[str, Any]:
    return {name: _by_intention(getattr(density, name)) for name in type(density).__dataclass_fields__}


def _by_intention(values: FloatArray | IntArray) -> dict[str, Any]:
    return {i.name: values[i].tolist() for i in _BOTH}


def _stacked(both: dict[str, Any]) -> Any:
    return np.array([both[i.name] for i in _BOTH])


def _sparse(counts: FloatArray | IntArray) -> list[list[float]]:
    return [[int(i), int(j), counts[i, j].item()] for i, j in np.argwhere(counts)]


def _dense(entries: list[list[float]], size: int) -> FloatArray:
    counts = np.zeros((size, size))
    for i, j, count in entries:
        if not 0 < count < MOST:
            raise ValueError(f"{count} is no count")
        if not (i in range(size) and j in range(size)) or counts[int(i), int(j)]:
            raise ValueError(f"{i}, {j} is no cell, or stands twice")
        counts[int(i), int(j)] = count
    return counts

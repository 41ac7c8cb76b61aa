"""What is learned from data, as counts in one small readable file, and the tables made from them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from merge_cosim.encounter import Intention
from merge_cosim.errors import UserError
from merge_cosim.units import FloatArray, IntArray

SCHEMA = 1
SPEED_BIN = 1.0
"""Width of a speed bin [m/s] (Dong, Dolan, Litkouhi 2017, Sec. IV-A)."""
SPEED_BINS = 40
TIME_BIN = 0.5
"""Width of a bin of time to arrival [s]."""
TIME_BINS = 30
MODELS = Path(__file__).parent / "models"
"""Where the models that come with the project lie."""


@dataclass(frozen=True)
class IntentionModel:
    """Counts over training pairs; index 0 is YIELD, index 1 NOT_YIELD.

    Attributes:
        name: Short name, shown in every row that rests on it.
        site, source: Where the training pairs come from.
        trained_on: Keys of the training merging cars, sorted; nobody may be tested on them.
        settings: How the pairs were chosen and split, for the reader.
        pairs: Number of pairs per intention, shape (2,).
        transitions: Counts of speed-bin transitions by lag in cycles, each (2, SPEED_BINS,
            SPEED_BINS) as [I, from, to].
        arrivals: Share of each pair's frames by time to arrival, summed over pairs, (2, TIME_BINS, TIME_BINS) as
            [I, T_m, T_h].
    """

    name: str
    site: str
    source: str
    trained_on: tuple[str, ...]
    settings: dict[str, Any]
    pairs: IntArray
    transitions: dict[int, IntArray]
    arrivals: FloatArray

    @property
    def prior_log_odds(self) -> float:
        """`log P(N) - log P(Y)`, from the shares of the training pairs."""
        return float(np.log(self.pairs[Intention.NOT_YIELD]) - np.log(self.pairs[Intention.YIELD]))

    def speed_probabilities(self, lag: int, epsilon: float) -> FloatArray:
        """Return P(V_t | V_{t-lag}, I), shape (2, SPEED_BINS, SPEED_BINS) as [I, from, to].

        `P = (1 - eps) n_I(ij) / n_I(i) + eps Q(j|i)`; Q pools both intentions under a kernel of one bin and stands
        alone where either intention has never been seen in a row. (With additive counts every unseen transition would
        speak for the rarer intention.)

        Raises:
            UserError: The model was not trained for this lag.
        """
        if lag not in self.transitions:
            raise UserError(
                f"model {self.name}: no transitions for transition_lag {lag} (has {sorted(self.transitions)})"
            )
        counts = self.transitions[lag].astype(np.float64)
        pooled = _blurred(counts.sum(axis=0))
        background = _normalised_rows(pooled)
        own = np.stack([_normalised_rows(count) for count in counts])
        seen = (counts.sum(axis=2) > 0).all(axis=0)[None, :, None]
        return np.where(seen, (1.0 - epsilon) * own + epsilon * background, background)

    def speed_log_odds(self, lag: int, epsilon: float) -> FloatArray:
        """Return `log P(V_t | V_{t-lag}, N) - log P(V_t | V_{t-lag}, Y)`, (SPEED_BINS, SPEED_BINS); 0 where unknown."""
        return _log_ratio(self.speed_probabilities(lag, epsilon))

    def time_probabilities(self, uniform: float) -> FloatArray:
        """Return P(T_m, T_h | I), shape (2, TIME_BINS, TIME_BINS), smoothed by one bin and mixed with uniform."""
        smooth = np.stack([_blurred(one) for one in self.arrivals])
        shares = smooth / smooth.sum(axis=(1, 2), keepdims=True)
        return (1.0 - uniform) * shares + uniform / shares[0].size

    def time_log_odds(self, uniform: float) -> FloatArray:
        """Return `log P(T_m, T_h | N) - log P(T_m, T_h | Y)`, shape (TIME_BINS, TIME_BINS)."""
        return _log_ratio(self.time_probabilities(uniform))

    def to_json(self) -> str:
        """The model as text, one entry per line, counts as sparse lists."""
        document = {
            "schema": SCHEMA,
            "name": self.name,
            "site": self.site,
            "source": self.source,
            "settings": self.settings,
            "pairs": {intention.name: int(self.pairs[intention]) for intention in _BOTH},
            "transitions": {
                str(lag): {intention.name: _sparse(counts[intention]) for intention in _BOTH}
                for lag, counts in self.transitions.items()
            },
            "arrivals": {intention.name: _sparse(self.arrivals[intention].round(6)) for intention in _BOTH},
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
                pairs=np.array([document["pairs"][intention.name] for intention in _BOTH]),
                transitions={
                    int(lag): np.stack([_dense(both[i.name], SPEED_BINS) for i in _BOTH]).astype(np.int64)
                    for lag, both in document["transitions"].items()
                },
                arrivals=np.stack([_dense(document["arrivals"][intention.name], TIME_BINS) for intention in _BOTH]),
            )
            if not ((model.pairs > 0).all() and (model.arrivals.sum(axis=(1, 2)) > 0).all()):
                raise ValueError("one intention has no pairs or no arrivals")
            return model
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise UserError(f"{file}: not a merge-cosim model ({error!r}); make one with 'merge-cosim train'") from None


_BOTH = (Intention.YIELD, Intention.NOT_YIELD)


def speed_bin(speed: FloatArray) -> IntArray:
    """Index of each speed's bin, clipped to the table."""
    return np.clip(speed / SPEED_BIN, 0, SPEED_BINS - 1).astype(np.int64)


def time_bin(time: FloatArray) -> IntArray:
    """Index of each time to arrival's bin; times beyond the table fall into its last bin."""
    return np.minimum(time / TIME_BIN, TIME_BINS - 1).astype(np.int64)


def _blurred(counts: FloatArray) -> FloatArray:
    from scipy.ndimage import gaussian_filter  # imported where a model is used: it is slow to import

    return gaussian_filter(counts, sigma=1.0, mode="constant")


def _normalised_rows(counts: FloatArray) -> FloatArray:
    total = counts.sum(axis=-1, keepdims=True)
    return np.divide(counts, total, out=np.zeros_like(counts), where=total > 0)


def _log_ratio(probabilities: FloatArray) -> FloatArray:
    known = (probabilities > 0).all(axis=0)
    logs = np.log(np.where(known, probabilities, 1.0))
    ratio: FloatArray = logs[Intention.NOT_YIELD] - logs[Intention.YIELD]
    return ratio


def _sparse(counts: FloatArray | IntArray) -> list[list[float]]:
    return [[int(i), int(j), counts[i, j].item()] for i, j in np.argwhere(counts)]


def _dense(entries: list[list[float]], size: int) -> FloatArray:
    counts = np.zeros((size, size))
    for i, j, count in entries:
        if not 0 <= count < np.inf:
            raise ValueError(f"{count} is no count")
        counts[int(i), int(j)] = count
    return counts

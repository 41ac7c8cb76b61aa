"""Constants of the drivers of `interactive`, fitted to logged merging cars by maximum likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import fmin_l_bfgs_b
from scipy.special import softmax
from scipy.stats import norm

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import AnyArray, BoolArray, FloatArray
from merge_cosim.estimators.interactive import Interactive
from merge_cosim.studies.judging import logged

WITHIN = 5.0
"""Accelerations beyond this [m/s^2] are filtered but not scored: what the filter gives to outliers, 1 / 10 per m/s^2,
is a density within it only."""
PER_CHUNK = 12
"""Encounters filtered side by side; with more, those that are over cost more than the calls that are saved."""
BOUNDS: dict[str, tuple[float, float]] = {
    "sigma": (0.05, 3.0),
    "correlation_time": (0.1, 30.0),
    "white": (0.003, 1.0),
    "rougher": (1.01, 8.0),
    "outlier": (1e-4, 0.5),
    "reaction_time": (0.02, 20.0),
    "change_rate": (1e-3, 3.0),
    "min_margin": (0.05, 6.0),
    "max_margin": (0.05, 6.0),
    "critical_gap": (0.5, 8.0),
    "waiting_braking": (0.2, 4.0),
    "driver_min_acceleration": (-8.0, -0.5),
    "driver_max_acceleration": (0.5, 8.0),
    "farthest_start": (5.0, 150.0),
}
"""What is fitted, beside the shares, and within which bounds; each on a logarithmic scale."""
STEPWISE = "critical_gap", "waiting_braking", "farthest_start"
"""The likelihood has steps over these, so they are searched on a grid, not by its gradient."""
GRID = 9
SHARES = tuple(f"start_{kind}" for kind in ("yield", "not_yield", "ignore", "accelerate", "late", "wait"))
"""Shares of the types at the start; the last is what the others leave, and no parameter."""
FARTHEST = 7.0
"""Bound of the logarithm of a share over that of `yield`."""
NAMES = (*BOUNDS, *SHARES[1:])
"""What is fitted: the logarithms of the sizes of the first, and of the shares over that of `yield`."""


@dataclass(frozen=True)
class Tracks:
    """Logged encounters as the filter sees them, to be filtered many times.

    Attributes:
        chunks: Rows, observations by cycle and which of them are scored, of encounters of like length.
        car: Number of each encounter's merging car, shape (n,).
        seconds: Time scored of each encounter [s], shape (n,).
        setting: The speed limit.
    """

    chunks: list[tuple[AnyArray, list[Observation], list[BoolArray]]]
    car: AnyArray
    seconds: FloatArray
    setting: Setting

    @classmethod
    def of(cls, encounters: Encounters, setting: Setting) -> Tracks:
        """Lay out encounters with logs; a cycle counts while neither car has reached the merging point."""
        seen, runs = zip(*logged(encounters), strict=True)
        speed = np.stack([one.merging_speed for one in seen])
        small = np.abs(np.diff(speed, axis=0, prepend=np.nan)) <= WITHIN * setting.dt
        scored = np.stack(runs) & small
        lasts = len(scored) - np.argmax(np.stack(runs)[::-1], axis=0)
        order = np.argsort(lasts, kind="stable")
        chunks = []
        for first in range(0, len(order), PER_CHUNK):
            rows = order[first : first + PER_CHUNK]
            until = int(lasts[rows].max())
            chunks.append((rows, [one.take(rows) for one in seen[:until]], [*scored[:until, rows]]))
        _, car = np.unique(encounters.car, return_inverse=True)
        return cls(chunks, car, scored.sum(axis=0) * setting.dt, setting)

    def by_car(self, values: FloatArray) -> FloatArray:
        """Sums of the values of encounters over each merging car."""
        return np.asarray(np.bincount(self.car, values), dtype=np.float64)


def log_likelihoods(estimator: Interactive, tracks: Tracks) -> FloatArray:
    """Sum of `log P(a_t | a_1 ... a_{t-1})` over the scored cycles of each encounter, by the filter; shape (n,)."""
    found = np.zeros(len(tracks.car))
    for rows, seen, scored in tracks.chunks:
        estimator.start(len(rows), tracks.setting)
        for one, counts in zip(seen, scored, strict=True):
            before = estimator.evidence.copy()
            estimator.update(one)
            found[rows] += np.where(counts, estimator.evidence - before, 0.0)
    return found


def autoregression(known: Tracks, tracks: Tracks, order: int) -> FloatArray:
    """Log likelihoods as `log_likelihoods`, under a Gaussian autoregression of the acceleration fitted to known tracks.

    The driver keeps its speed but for noise: `a_t = c_1 a_{t-1} + ... + e_t`, by least squares. The first `order`
    accelerations of a track have the variance of all.
    """
    _, now, before = _windows(known, order)
    whole = np.isfinite(before).all(axis=1)
    factors = np.linalg.lstsq(before[whole], now[whole], rcond=None)[0]
    sigma, first = (now - before @ factors)[whole].std(), now.std()
    rows, now, before = _windows(tracks, order)
    whole = np.isfinite(before).all(axis=1)
    off = np.where(whole, now - before @ factors, now)
    found = norm.logpdf(off, scale=np.where(whole, sigma, first))
    return np.asarray(np.bincount(rows, found, len(tracks.car)), dtype=np.float64)


def _windows(tracks: Tracks, order: int) -> tuple[AnyArray, FloatArray, FloatArray]:
    rows, now, before = [], [], []
    for chunk, seen, scored in tracks.chunks:
        speed = np.stack([one.merging_speed for one in seen])
        first = np.full((order + 1, len(chunk)), np.nan)
        acceleration = np.concatenate([first, np.diff(speed, axis=0) / tracks.setting.dt])
        cycle, place = np.nonzero(np.stack(scored))
        rows.append(chunk[place])
        now.append(acceleration[cycle + order, place])
        before.append(np.stack([acceleration[cycle + order - lag, place] for lag in range(1, order + 1)], axis=1))
    return np.concatenate(rows), np.concatenate(now), np.concatenate(before)


def maximise(
    tracks: Tracks,
    start: Interactive,
    free: Sequence[str] = NAMES,
    weight: FloatArray | None = None,
    rounds: int = 2,
    steps: int = 60,
) -> tuple[Interactive, float]:
    """Maximise the likelihood: by its gradient (L-BFGS-B), then over the grid of each stepwise parameter, in rounds.

    Args:
        tracks: The encounters.
        start: The constants to begin at, brought within the bounds; what is not free stays so.
        free: Names of what is fitted, of `NAMES`.
        weight: How often each merging car counts, shape (cars,); once, if None.
        rounds: Most rounds; the last is one that gains less than 0.05.
        steps: Most steps by the gradient in each.

    Returns:
        The estimator with the constants found, and the log likelihood.
    """
    smooth = np.array([name in free and name not in STEPWISE for name in NAMES])
    limits = [_limits(name) for name in NAMES]

    def loss(vector: FloatArray) -> float:
        found = tracks.by_car(log_likelihoods(_estimator(start, vector), tracks))
        return -float(found.sum() if weight is None else found @ weight)

    def with_smooth(values: FloatArray) -> FloatArray:
        vector = best.copy()
        vector[smooth] = values
        return vector

    best = np.clip(_vector(start), *np.transpose(limits))
    least = loss(best)
    for _ in range(rounds):
        before = least
        if smooth.any():
            values, least, _ = fmin_l_bfgs_b(
                lambda values: loss(with_smooth(values)),
                best[smooth],
                approx_grad=True,
                bounds=[limit for limit, moves in zip(limits, smooth, strict=True) if moves],
                factr=1e9,
                epsilon=1e-4,
                maxiter=steps,
            )
            best = with_smooth(values)
        for place in (NAMES.index(name) for name in STEPWISE if name in free):
            for value in np.linspace(*limits[place], num=GRID):
                tried = best.copy()
                tried[place] = value
                there = loss(tried)
                if there < least:
                    best, least = tried, there
        if before - least < 0.05:
            break
    return _estimator(start, best), -least


def resampled(
    tracks: Tracks, start: Interactive, free: Sequence[str] = NAMES, draws: int = 20, steps: int = 25
) -> list[Interactive]:
    """Fits to merging cars drawn with replacement, each from the same start: the bootstrap."""
    rng = np.random.default_rng(0)
    cars = int(tracks.car.max()) + 1
    weights = (np.bincount(rng.integers(cars, size=cars), minlength=cars).astype(float) for _ in range(draws))
    return [maximise(tracks, start, free, weight, rounds=1, steps=steps)[0] for weight in weights]


def constants(estimator: Interactive) -> dict[str, float]:
    """What is fitted, by name; with the share of `wait`, which is what the others leave."""
    found = {name: float(getattr(estimator, name)) for name in (*BOUNDS, *SHARES[:-1])}
    return found | {SHARES[-1]: max(1.0 - sum(found[name] for name in SHARES[:-1]), 0.0)}


def _vector(estimator: Interactive) -> FloatArray:
    values = constants(estimator)
    sizes = [np.log(abs(values[name])) for name in BOUNDS]
    shares = np.log([max(values[name], 1e-9) for name in SHARES])
    return np.array([*sizes, *(shares[1:] - shares[0])])


def _estimator(base: Interactive, vector: FloatArray) -> Interactive:
    sizes = np.exp(vector[: len(BOUNDS)])
    signs = np.copysign(1.0, [bound for bound, _ in BOUNDS.values()])
    found: dict[str, Any] = dict(zip(BOUNDS, (signs * sizes).tolist(), strict=True))
    low, high = sorted((found["min_margin"], found["max_margin"]))
    found |= {"min_margin": low, "max_margin": high}
    shares = softmax([0.0, *vector[len(BOUNDS) :]]).tolist()
    found |= dict(zip(SHARES[:-1], shares[:-1], strict=True))
    return replace(base, **found)


def _limits(name: str) -> tuple[float, float]:
    if name not in BOUNDS:
        return -FARTHEST, FARTHEST
    low, high = sorted(abs(bound) for bound in BOUNDS[name])
    return float(np.log(low)), float(np.log(high))

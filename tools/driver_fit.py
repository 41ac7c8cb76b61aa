"""Fit the drivers of `interactive` to recorded ones: python tools/driver_fit.py --data DIR [--other RAMP DATA].

Fills the blocks `<!-- fit: NAME -->` ... `<!-- end -->` of docs/methods/interactive.md. The constants maximise the
likelihood of the accelerations of the merging cars of US-101 that `merge-cosim train` trains on; the other merging
cars, the surrogate's of I-80 and, with --other (a ramp's folder with `site.toml`, and that site's data), those of
another site judge them. Without --data the pairs of US-101 are the surrogate's, too.
"""

import shlex
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from blocks import fill_page, page_parser, table
from kept_aside_page import pairs_of
from method_proof import COSTS, PAGE, SEED, costs
from scipy.stats import chi2

import merge_cosim as mc
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import FloatArray
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.interactive import Interactive
from merge_cosim.estimators.learned.fitting import fit
from merge_cosim.ngsim.pairing.split import folds_of, split_cars
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.statistics.rates import bootstrap_sums
from merge_cosim.studies.driver_fit import (
    BOUNDS,
    NAMES,
    SHARES,
    Tracks,
    autoregression,
    constants,
    log_likelihoods,
    maximise,
    resampled,
)
from merge_cosim.studies.judging import DISTANCES, JUDGED, calibration, open_loop, score

NOISE = "sigma", "correlation_time", "white", "rougher", "outlier"
ALIKE = dict.fromkeys(SHARES[:-1], 1 / 6) | {"change_rate": 1.0, "reaction_time": 0.3}
"""A second start: all types alike, drivers who react soon and change often."""
STEADY = dict.fromkeys(SHARES[:-1], 0.0) | {"start_ignore": 1.0}
DRAWS, MOST_CARS, SHORT_CARS = 20, 40, 6
AS_LIKELY = chi2.ppf(0.95, 1) / 2
TEST = {"encounters.count": 2000} | dict.fromkeys(SEED, 10)


@dataclass(frozen=True)
class Site:
    """Pairs that judge the constants: what they are called, and their speed limit [m/s]."""

    name: str
    pairs: Encounters
    limit: float

    @property
    def tracks(self) -> Tracks:
        """What the filter sees of them."""
        return Tracks.of(self.pairs, Setting(self.limit))


@dataclass(frozen=True)
class Found:
    """What was fitted.

    Attributes:
        sites: The pairs trained on, those kept aside, and those of other sites.
        models: Constants by name, of which `shipped` and `fitted`.
        ends: The 95 % interval of each constant, by name.
        losses: What the log likelihood loses where a constant is as shipped and the others are fitted again.
        gained: How much more likely the best start became than the other one.
    """

    sites: list[Site]
    models: dict[str, Interactive]
    ends: dict[str, tuple[float, float]]
    losses: dict[str, float]
    gained: float


def site(name: str, data: Path | None, most: int | None, said: str = "") -> Site:
    """Pairs of a site, of the first merging cars by a hash of their names where there are too many."""
    pairs = pairs_of(name, data, None)
    cars = len(np.unique(pairs.car))
    if most is not None and cars > most:
        pairs = pairs.take(np.flatnonzero(folds_of(pairs, cars) < most))
    return Site(f"{said or name} ({pairs.source[0]})", pairs, Ramp.load(name).speed_limit)


def rounded(estimator: Interactive) -> Interactive:
    """The constants as they are printed."""
    return replace(estimator, **{name: float(f"{getattr(estimator, name):.3g}") for name in (*BOUNDS, *SHARES[:-1])})


def fitted(data: Path | None, others: Sequence[tuple[str, Path]], short: bool) -> Found:
    """Fit all constants, the noise only, and the noise of a driver who keeps its speed."""
    every = site("us101", data, 3 * (SHORT_CARS if short else MOST_CARS), "US-101")
    known = split_cars(every.pairs, 1 / 3, 0)
    parts = [
        replace(every, name=f"{name}, {every.name}", pairs=every.pairs.take(np.flatnonzero(chosen)))
        for name, chosen in (("training", known), ("kept aside", ~known))
    ]
    tracks, steps, free = parts[0].tracks, (2 if short else 60), (NOISE if short else NAMES)
    shipped = Interactive()
    starts = [shipped] if short else [shipped, replace(shipped, **ALIKE)]
    found = sorted((maximise(tracks, start, free, steps=steps) for start in starts), key=lambda one: -one[1])
    best, most = found[0]
    again = 1 if short else 20
    draws = pd.DataFrame(constants(one) for one in resampled(tracks, best, free, 2 if short else DRAWS, steps=again))
    losses = {}
    for name in (*BOUNDS, "shares"):
        held = SHARES if name == "shares" else (name,)
        if short and name not in NOISE[:1]:
            continue
        back = replace(best, **{one: getattr(shipped, one) for one in held if hasattr(shipped, one)})
        left = [one for one in free if one not in held]
        losses[name] = most - maximise(tracks, back, left, rounds=1, steps=again)[1]
    models = {
        "shipped": shipped,
        "fitted": best,
        "noise fitted": maximise(tracks, shipped, NOISE, steps=steps)[0],
        "constant speed, noise fitted": maximise(tracks, replace(shipped, **STEADY), NOISE, steps=steps)[0],
    }
    models = {name: one if name == "shipped" else rounded(one) for name, one in models.items()}
    ends = {name: (float(draws[name].quantile(0.025)), float(draws[name].quantile(0.975))) for name in draws}
    sites = parts if short else [*parts, site("i80", None, None, "I-80")]
    sites += [site(name, folder, None, Path(name).name) for name, folder in others]
    return Found(sites, models, ends, losses, most - found[-1][1])


def told(name: str, low: float, high: float, before: float, lost: float | None) -> str:
    """Whether the data tell a constant.

    They do not where the interval has half of what was allowed, or leaves out the shipped value, which is as likely.
    """
    wide = high - low > 0.5
    if name in BOUNDS:
        first, last = sorted(np.log(np.abs(BOUNDS[name])))
        wide = abs(np.log(high / low)) > 0.5 * (last - first)
    flat = lost is not None and lost < AS_LIKELY and not low <= before <= high
    return "no" if wide or flat else "yes"


def table_of_constants(found: Found) -> str:
    """Each constant as shipped and as fitted."""
    before, after = constants(found.models["shipped"]), constants(found.models["fitted"])
    rows = []
    for name, value in after.items():
        low, high = found.ends[name]
        lost = found.losses.get("shares" if name == SHARES[0] else name)
        rows.append(
            [
                f"`{name}`" if hasattr(Interactive, name) else name,
                f"{before[name]:.3g}",
                f"{value:.3g}",
                f"{low:.3g} to {high:.3g}",
                told(name, low, high, before[name], lost),
                "" if lost is None else f"{lost:.1f}",
            ]
        )
    tracks = found.sites[0].tracks
    words = (
        f"{found.sites[0].name}: {len(tracks.car)} pairs of {tracks.car.max() + 1} merging cars, "
        f"{tracks.seconds.sum():.0f} s. The better of the two starts is more likely by {found.gained:.1f} (log)."
    )
    head = ["constant", "shipped", "fitted", "95 %", "told by the data", "log likelihood lost if as shipped"]
    return f"{textwrap.fill(words, 120)}\n\n{table(head, rows)}"


def table_of_losses(found: Found) -> str:
    """Log likelihood per second of each model, and how it differs from the shipped one."""
    known, every = found.sites[0].tracks, [one.tracks for one in found.sites]
    values: dict[str, list[FloatArray]] = {
        name: [log_likelihoods(one, tracks) for tracks in every] for name, one in found.models.items()
    }
    for order in (1, 2):
        values[f"Gaussian AR({order})"] = [autoregression(known, tracks, order) for tracks in every]
    rows = []
    for name, here in values.items():
        cells = []
        for tracks, value, shipped in zip(every, here, values["shipped"], strict=True):
            seconds = tracks.by_car(tracks.seconds)
            cell = f"{value.sum() / seconds.sum():.2f}"
            if name != "shipped":
                more, time = (pd.DataFrame({"": one}) for one in (tracks.by_car(value - shipped), seconds))
                ((low, high),) = bootstrap_sums(more, time)
                cell += f" ({low:+.2f} to {high:+.2f})"
            cells.append(cell)
        rows.append([name, *cells])
    return table(["log likelihood per second", *(one.name for one in found.sites)], rows)


def rivals(known: Encounters, short: bool) -> dict[str, Estimator]:
    """The other estimators of probabilities, trained on the same cars."""
    model, made = fit(known, "drivers", {}), {}
    for name in JUDGED[:1] if short else JUDGED:
        made[name] = estimators[name]()
        if made[name].needs_model:
            made[name].use(model)
    return made


def table_of_order(found: Found, short: bool) -> str:
    """Accuracy and log loss of P(N), by distance on the cars kept aside, and whole on the other sites."""
    shown: dict[str, Estimator] = {name: one for name, one in found.models.items() if name != "noise fitted"}
    others = rivals(found.sites[0].pairs, short)
    rows, bins = [], []
    for place in found.sites[1:]:
        watched = {name: open_loop(one, place.pairs) for name, one in (shown | others).items()}
        aside = place is found.sites[1]
        for near, far in DISTANCES if aside else ((0.0, np.inf),):
            scores = {name: score(one.between(near, far)) for name, one in watched.items()}
            known = {name: one for name, one in scores.items() if name in others and one["log_loss"] is not None}
            best = min(known, key=lambda name: known[name]["log_loss"])
            cells = [f"{scores[name]['accuracy_pct']:.1f} [{scores[name]['log_loss']:.3f}]" for name in (*shown, best)]
            cells[-1] += f" `{best}`"
            rows.append([place.name, f"{near:g} to {far:g}" if aside else "all", *cells])
        if aside:
            both = [calibration(watched[name]) for name in ("shipped", "fitted")]
            edges = sorted({(row["p_from"], row["p_to"]) for one in both for row in one})
            for low, high in edges:
                cells = [f"{low:g} to {high:g}"]
                for one in both:
                    here = [row for row in one if row["p_from"] == low]
                    cells += [str(here[0]["frames"]), f"{here[0]['not_yield_share']:.2f}"] if here else ["0", ""]
                bins.append(cells)
    head = ["cars", "distance [m]", *(f"{name}: right [%], log loss" for name in (*shown, "best of the others"))]
    columns = [f"{name}: {what}" for name in ("shipped", "fitted") for what in ("frames", "did not yield")]
    return f"{table(head, rows, left=2)}\n{table(['P(N)', *columns], bins)}"


def table_of_driving(found: Found, data: Path | None, short: bool) -> str:
    """What the constants change where `interactive` drives."""
    tests: dict[str, dict[str, Any]] = {"designed-3": TEST, "us101-replay": {"encounters.sites": {"us101": "train"}}}
    rows, words = [], []
    for scenario, settings in tests.items():
        given = settings | ({"encounters.count": 20} if short and scenario == "designed-3" else {})
        for name, one in [*found.models.items()][: 2 if short else None]:
            done = mc.sweep(
                [scenario],
                ["interactive"],
                settings=given | ({} if name == "shipped" else settings_of(one)),
                data=data,
                world="closed-form",
                jobs=1,
                progress=False,
            )
            (row,) = done.summary().itertuples()
            rows.append(
                [
                    f"{scenario} ({row.source})",
                    name,
                    str(row.n),
                    str(row.failures),
                    str(row.stuck),
                    *costs(row),
                ]
            )
        words.append(command(scenario, settings))
    head = ["scenario", "constants", "n", "failed", "stuck", *COSTS]
    asked = "\n".join(words)
    return f"```\n{asked}\n```\n\n{table(head, rows, left=2)}"


def settings_of(estimator: Interactive) -> dict[str, float]:
    """The constants as settings of a sweep."""
    return {f"interactive.{name}": getattr(estimator, name) for name in (*BOUNDS, *SHARES[:-1])}


def command(scenario: str, settings: Mapping[str, Any]) -> str:
    """The sweep as it is shipped, on the command line."""
    words = ["merge-cosim", "sweep", scenario, "--method", "interactive", "--world", "closed-form"]
    for name, value in settings.items():
        written = '{us101="train"}' if isinstance(value, dict) else str(value)
        words += ["--set", f"{name}={written}"]
    return shlex.join([*words, "--out", "out/fit"])


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the blocks."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, help="folder with real NGSIM files")
    parser.add_argument("--other", nargs=2, metavar=("RAMP", "DATA"), help="another site and its data")
    given = parser.parse_args(argv)
    others = [] if given.other is None else [(given.other[0], Path(given.other[1]))]
    study = cache(lambda: fitted(given.data, others, given.short))
    blocks = {
        "constants": lambda: table_of_constants(study()),
        "losses": lambda: table_of_losses(study()),
        "order": lambda: table_of_order(study(), given.short),
        "driving": lambda: table_of_driving(study(), given.data, given.short),
    }
    fill_page(PAGE, given.docs, {"fit": lambda name: blocks[name]()})


if __name__ == "__main__":
    main()

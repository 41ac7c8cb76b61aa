"""Whether rates hold on cars kept aside: python tools/kept_aside_page.py --data DIR [--other RAMP DATA].

Fills the block `<!-- kept: us101 -->` ... `<!-- end -->` of docs/results.md and, with --other (a ramp's folder with
`site.toml`, and that site's data), `<!-- kept: other -->`. The merging cars of US-101 are dealt into three parts. Each
part in turn is kept aside; from the other two come predictions: each is driven with the model trained on the other, so
no car kept aside is seen. The cars kept aside are then driven with the model trained on both.
"""

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from blocks import fill_page, page_parser, table
from scipy.stats import betabinom, t

import merge_cosim as mc
from merge_cosim.core.encounter import Encounters
from merge_cosim.estimators.learned.fitting import fit
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.pairing.split import folds_of
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scenarios.encounters import SourceChoice, pairs_of_site
from merge_cosim.scenarios.sources import Pairs

METHODS = (
    "acc",
    "slot",
    "ipcb",
    "pgm-g",
    "pgm",
    "pgm-symmetric",
    "fg",
    "fg-gmm",
    "dbn-pf",
    "always-go",
    "always-yield",
)
PARTS, SEEDS = 3, 2
LEVEL = 0.95


def pairs_of(site: str, data: Path, source: SourceChoice | None = "ngsim") -> Encounters:
    """All pairs of a site."""
    rules = Pairs.model_validate({"kind": "pairs", "sites": {site: "all"}})
    return pairs_of_site(site, rules, data, source)


def learned(encounters: Encounters, chosen: np.ndarray, methods: Sequence[str]) -> IntentionModel | None:
    """A model of some of the pairs, for methods of which some learn."""
    return fit(encounters.take(np.flatnonzero(chosen)), "kept-aside", {}) if len(methods) > 1 else None


def driven(encounters: Encounters, model: IntentionModel | None, limit: float, methods: Sequence[str]) -> pd.DataFrame:
    """Result rows of logged pairs under a model, without the censored ones."""
    settings = {"speed_limit": limit}
    done = mc.sweep(
        encounters, list(methods), model=model, settings=settings, world="closed-form", jobs=1, progress=False
    )
    rows = done.rows
    return rows[rows["method"].isin(methods) & ~rows["censored"]]


def crossed(pairs: Encounters, part: np.ndarray, limit: float, methods: Sequence[str]) -> pd.DataFrame:
    """Rows of all pairs in two parts, each driven with the model of the other."""
    numbers = np.unique(part[part >= 0])
    done = [
        driven(pairs.take(np.flatnonzero(part == one)), learned(pairs, part == other, methods), limit, methods)
        for one, other in (numbers, numbers[::-1])
    ]
    return pd.concat(done)


def rate_interval(known: pd.DataFrame, cars: int) -> tuple[float, float]:
    """Interval of a failure rate [%] among further cars: beta-binomial, Jeffreys' prior, a car as one observation."""
    n = known["car"].nunique()
    failures = known["failed"].mean() * n
    law = betabinom(cars, failures + 0.5, n - failures + 0.5)
    low, high = law.ppf((1 - LEVEL) / 2), law.ppf((1 + LEVEL) / 2)
    return 100 * low / cars, 100 * high / cars


def delay_interval(known: pd.DataFrame, cars: int) -> tuple[float, float]:
    """Interval of the mean delay [s] of further cars, from the means of the cars known: Student's t."""
    means = known.groupby("car")["delay_s"].mean()
    n = len(means)
    half = t.ppf((1 + LEVEL) / 2, n - 1) * means.std() * np.sqrt(1 / n + 1 / cars)
    return means.mean() - half, means.mean() + half


def checks(known: pd.DataFrame, kept: pd.DataFrame) -> Iterator[dict[str, object]]:
    """For each method the predicted intervals, and what the cars kept aside gave."""
    for method, rows in kept.groupby("method", sort=False):
        before, cars = known[known["method"] == method], rows["car"].nunique()
        rate, delay = 100 * rows["failed"].mean(), rows.groupby("car")["delay_s"].mean().mean()
        (low, high), (soon, late) = rate_interval(before, cars), delay_interval(before, cars)
        yield {
            "method": method,
            "rate": rate,
            "rate_low": low,
            "rate_high": high,
            "delay": delay,
            "delay_low": soon,
            "delay_high": late,
            "pairs": len(rows),
            "cars": cars,
            "rate_in": low - 1e-9 <= rate <= high + 1e-9,
            "delay_in": soon <= delay <= late,
        }


def us101(data: Path, short: bool) -> str:
    """Every part kept aside in turn, for some ways of dealing."""
    pairs, limit = pairs_of("us101", data), Ramp.load("us101").speed_limit
    methods, seeds = (METHODS[:1], 1) if short else (METHODS, SEEDS)
    found = []
    for seed in range(seeds):
        part = folds_of(pairs, PARTS, seed)
        for aside in range(PARTS):
            known = crossed(pairs, np.where(part == aside, -1, part), limit, methods)
            kept = driven(
                pairs.take(np.flatnonzero(part == aside)), learned(pairs, part != aside, methods), limit, methods
            )
            found += checks(known, kept)
    rows = pd.DataFrame(found)
    lines = [
        [
            f"`{method}`",
            f"{one['rate_low'].mean():.1f} to {one['rate_high'].mean():.1f}",
            f"{one['rate'].min():.1f} to {one['rate'].max():.1f}",
            f"{int(one['rate_in'].sum())} of {len(one)}",
            f"{one['delay_low'].mean():.2f} to {one['delay_high'].mean():.2f}",
            f"{one['delay'].min():.2f} to {one['delay'].max():.2f}",
            f"{int(one['delay_in'].sum())} of {len(one)}",
        ]
        for method, one in rows.groupby("method", sort=False)
    ]
    head = [
        "method",
        "predicted %, mean",
        "kept aside %",
        "inside",
        "predicted delay s, mean",
        "kept aside s",
        "inside",
    ]
    words = (
        f"{seeds} ways to deal {len(np.unique(pairs.car))} cars ({len(pairs)} pairs) into {PARTS} parts, so "
        f"{seeds * PARTS} predictions per method. Inside: {int(rows['rate_in'].sum())} of {len(rows)} failure rates "
        f"({100 * rows['rate_in'].mean():.0f} %) and {int(rows['delay_in'].sum())} of {len(rows)} mean delays "
        f"({100 * rows['delay_in'].mean():.0f} %)."
    )
    return f"{textwrap.fill(words, 120)}\n\n{table(head, lines)}"


def other(data: Path, ramp: Path, its_data: Path, short: bool) -> str:
    """Another site, predicted from US-101."""
    pairs, methods = pairs_of("us101", data), METHODS[:1] if short else METHODS
    known = crossed(pairs, folds_of(pairs, 2, 0), Ramp.load("us101").speed_limit, methods)
    there = pairs_of(str(ramp), its_data, None)
    model = learned(pairs, np.ones(len(pairs), dtype=bool), methods)
    rows = pd.DataFrame(checks(known, driven(there, model, Ramp.load(str(ramp)).speed_limit, methods)))
    lines = [
        [
            f"`{row['method']}`",
            f"{row['rate_low']:.1f} to {row['rate_high']:.1f}",
            f"{row['rate']:.1f}",
            "yes" if row["rate_in"] else "no",
            f"{row['delay_low']:.2f} to {row['delay_high']:.2f}",
            f"{row['delay']:.2f}",
            "yes" if row["delay_in"] else "no",
        ]
        for row in rows.to_dict("records")
    ]
    head = ["method", "predicted %", "there %", "inside", "predicted delay s", "there s", "inside"]
    words = (
        f"{int(rows['pairs'].max())} pairs of {int(rows['cars'].max())} merging cars. Inside: "
        f"{int(rows['rate_in'].sum())} of {len(rows)} failure rates and {int(rows['delay_in'].sum())} of {len(rows)} "
        "mean delays."
    )
    return f"{textwrap.fill(words, 120)}\n\n{table(head, lines)}"


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the blocks."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with real NGSIM files")
    parser.add_argument("--other", type=Path, nargs=2, metavar=("RAMP", "DATA"), help="another site and its data")
    given = parser.parse_args(argv)

    def kept(which: str) -> str | None:
        if which == "us101":
            return us101(given.data, given.short)
        return None if given.other is None else other(given.data, *given.other, given.short)

    fill_page("results.md", given.docs, {"kept": kept})


if __name__ == "__main__":
    main()

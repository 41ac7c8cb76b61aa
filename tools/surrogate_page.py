"""Compare the surrogate with real NGSIM pairs: python tools/surrogate_page.py --data DIR fills docs/surrogate.md."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from blocks import fill_page, page_parser, table
from scipy.stats import ks_2samp
from sklearn.metrics import roc_auc_score

from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.units import DT, FloatArray, time_to_arrival
from merge_cosim.ngsim.pairing.encounters import site_pairs
from merge_cosim.ngsim.pairing.pairs import Paired
from merge_cosim.ngsim.pairing.summary import summarise
from merge_cosim.ngsim.sites import site as find_site
from merge_cosim.ngsim.surrogate.recipe import RECIPES
from merge_cosim.ngsim.surrogate.surrogate import cached_surrogate

BANDS = ((0, 40), (40, 70), (70, 110), (110, np.inf))
"""Distances to the lane change [m] by which the ambiguity of the order is grouped."""
QUANTILES = (5, 50, 95)
SHORT = {"seeds": (1,), "duration": 240.0, "warm_up": 60.0}
"""What a recipe has in short mode: one recording of a few minutes, of the first site alone."""
COLORS = {"real": "0.15", "surrogate": "#d9480f"}
Measure = Callable[[Encounters], FloatArray]


def stations(e: Encounters, car: str) -> list[FloatArray]:
    """Smoothed stations [m] of the `merging` or the `host` car of each pair, from the window's start to the change."""
    assert e.log is not None
    track = getattr(e.log, f"{car}_station")
    return [track[row][: int(last) + 1] for row, last in enumerate(e.log.change_cycle)]


def speed(car: str) -> Measure:
    """Speeds [m/s] of every frame."""
    return lambda e: np.concatenate([np.diff(s) / DT for s in stations(e, car)])


def acceleration(car: str) -> Measure:
    """Accelerations [m/s^2] of every frame, of smoothed stations."""
    return lambda e: np.concatenate([np.diff(s, n=2) / DT**2 for s in stations(e, car)])


def approach(e: Encounters) -> tuple[FloatArray, ...]:
    """T_m [s], T_h [s], way left to the merging car [m] and label, of every frame with both ahead of the change."""
    frames = []
    for m, h, label in zip(stations(e, "merging"), stations(e, "host"), e.label, strict=True):
        both = (m[1:] < 0) & (h[1:] < 0)
        t_m, t_h = (time_to_arrival(s[1:], np.diff(s) / DT)[both] for s in (m, h))
        frames.append((t_m, t_h, -m[1:][both], np.full(int(both.sum()), float(label))))
    return tuple(np.concatenate(column) for column in zip(*frames, strict=True))


def per_car(e: Encounters) -> Encounters:
    """One pair of each merging car."""
    return e.take(np.unique(e.car, return_index=True)[1])


def apart(label: Intention) -> Measure:
    """Front-to-front distance [m] at the lane change to the hosts that passed first, or second."""
    return lambda e: np.array([abs(s[-1]) for s in stations(e, "host")])[e.label == label]


MEASURES: dict[str, Measure] = {
    "host's speed [m/s]": speed("host"),
    "merging car's speed [m/s]": speed("merging"),
    "host's acceleration [m/s²]": acceleration("host"),
    "merging car's acceleration [m/s²]": acceleration("merging"),
    "time to arrival T_m [s]": lambda e: approach(e)[0],
    "time to arrival T_h [s]": lambda e: approach(e)[1],
    "T_m − T_h [s]": lambda e: np.subtract(*approach(e)[:2]),
    "merging distance in the window [m]": lambda e: -e.merging_station,
    "lane change, past the gore [m]": lambda e: per_car(e).merge_position,
    "speed at the lane change [m/s]": lambda e: np.array([s[-1] - s[-2] for s in stations(per_car(e), "merging")]) / DT,
    "to the car ahead at the change [m]": apart(Intention.YIELD),
    "to the car behind at the change [m]": apart(Intention.NOT_YIELD),
}


def auc(e: Encounters) -> list[float]:
    """How well T_h - T_m separates the labels in each of `BANDS`."""
    t_m, t_h, left, label = approach(e)
    bands = [(low <= left) & (left < high) for low, high in BANDS]
    both = [len(np.unique(label[band])) == 2 for band in bands]  # few pairs may have one label only
    return [
        float(roc_auc_score(label[band], (t_h - t_m)[band])) if judged else np.nan
        for band, judged in zip(bands, both, strict=True)
    ]


def quantiles(values: FloatArray) -> str:
    """The 5, 50 and 95 % quantiles."""
    return " / ".join(f"{round(q, 1) + 0.0:.1f}" for q in np.percentile(values, QUANTILES))


def aggregates(site: str, named: dict[str, Paired]) -> str:
    """The data sets in numbers, the published ones first."""
    rows = []
    for name, paired in named.items():
        facts = summarise(paired, site)
        if not rows and (paper := facts.published):
            rows.append(["published", str(paper.pairs), str(paper.merge_distance_m), str(paper.speed_m_s), "", ""])
        rows.append(
            [
                name,
                str(facts.pairs),
                f"{facts.merge_distance_m:.1f}",
                f"{facts.speed_m_s:.1f}",
                f"{100 * facts.yielding:.0f} %",
                f"{100 * len(paired.rejected.get('host_changes_lane', ())) / max(facts.pairs, 1):.0f} %",
            ]
        )
    head = ("", "pairs", "L_merge [m]", "speed [m/s]", "yielding", "rejected: the host changes lane, of the pairs")
    return table(head, rows).rstrip()


def comparison(named: dict[str, Encounters]) -> str:
    """Quantiles of every measure, and Kolmogorov-Smirnov distances where there are two sets."""
    rows = []
    for title, measure in MEASURES.items():
        values = [measure(e) for e in named.values()]
        distance = [f"{ks_2samp(*values).statistic:.2f}"] if len(values) == 2 else []
        rows.append([title, *map(quantiles, values), *distance])
    head = ["5 / 50 / 95 %", *named, *(["KS distance"] if len(named) == 2 else [])]
    return table(head, rows).rstrip()


def ambiguity(named: dict[str, Encounters]) -> str:
    """AUC of T_h - T_m by distance."""
    head = ["AUC", *(f"{low:g}-{high:g} m" if high < np.inf else f"over {low:g} m" for low, high in BANDS)]
    return table(head, [[name, *(f"{value:.3f}" for value in auc(e))] for name, e in named.items()]).rstrip()


def draw(named: dict[str, Encounters], target: Path) -> None:
    """Histograms of every measure, one panel each."""
    figure, panels = plt.subplots(3, 4, figsize=(12, 7.2), layout="constrained")
    for panel, (title, measure) in zip(panels.flat, MEASURES.items(), strict=True):
        values = {name: measure(e) for name, e in named.items()}
        low, high = np.percentile(np.concatenate(list(values.values())), [0.5, 99.5])
        bins = np.linspace(low, high, 31)
        for name, each in values.items():
            panel.hist(each, bins, density=True, histtype="step", linewidth=1.5, color=COLORS[name], label=name)
        panel.set_xlabel(title)
        panel.set_yticks([])
        panel.spines[["top", "right", "left"]].set_visible(False)
    panels.flat[0].legend(frameon=False, loc="upper left", fontsize="small")
    figure.savefig(target, dpi=80)
    plt.close(figure)


def section(site: str, title: str, named: dict[str, Paired], docs: Path) -> str:
    """One site: tables, and a picture in the folder of the page."""
    encounters = {name: paired.encounters for name, paired in named.items()}
    draw(encounters, docs / "img" / f"surrogate-{site}.png")
    return "\n\n".join(
        [
            aggregates(site, named),
            f"![Distributions of the pairs of {title}](img/surrogate-{site}.png)",
            comparison(encounters),
            "How well T_h − T_m predicts which car goes first, by the merging car's distance to its lane change:",
            ambiguity(encounters) + "\n",
        ]
    )


TRAFFIC = """\
{minutes:.0f} minutes of traffic per site, in {recordings} recordings with a seed each: with one version of SUMO the
same bytes every time. All drivers use SUMO's car-following model EIDM with its lane-change model LC2013; the on-ramp's
cars come at even intervals, the others at random ones. The recipe (`merge_cosim/ngsim/surrogate/recipe.py`) was set by
hand so that number of pairs, distance to the lane change, speeds and share of yielding are close to the published
figures (Dong, Dolan, Litkouhi 2017, Table I) and, on US-101, to the real pairs. No method was run on it for that.

Made by `python tools/surrogate_page.py --data DIR` with the NGSIM files in `DIR`. 'Real' is what that folder held:
{held}.
Where these are fragments, not complete periods, windows and merging distances are shorter.
Speeds and accelerations are those of the smoothed positions, by the same filter for both.
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the blocks."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with real NGSIM files")
    given = parser.parse_args(argv)
    (given.docs / "img").mkdir(parents=True, exist_ok=True)
    recipes = {name: replace(recipe, **(SHORT if given.short else {})) for name, recipe in RECIPES.items()}
    made, held = {}, []
    for site in map(find_site, ("us101",) if given.short else recipes):
        surrogate = site_pairs(cached_surrogate(recipes[site.name]), site, source="surrogate")
        real = site_pairs(given.data, site)
        assert surrogate is not None
        if real is not None:
            held.append(f"{len(real.encounters)} pairs of {len(np.unique(real.encounters.car))} cars of {site.title}")
        named = ({"real": real} if real else {}) | {"surrogate": surrogate}
        made[site.name] = section(site.name, site.title, named, given.docs)
    recipe = recipes["us101"]
    recordings = len(recipe.seeds)
    minutes = recordings * recipe.duration / 60
    made["traffic"] = TRAFFIC.format(minutes=minutes, recordings=recordings, held="; ".join(held) or "nothing")
    fill_page("surrogate.md", given.docs, {"surrogate": made.get})


if __name__ == "__main__":
    main()

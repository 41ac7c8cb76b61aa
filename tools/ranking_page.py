"""Write docs/ranking.md: which of the choices that the papers leave open decide the order of the methods.

    python tools/ranking_page.py

sweeps Designed Test II in closed form for every combination of speed limit, car length and meaning of 'ahead', and
every estimator under every controller; draws a heat map per method and counts where the published order appears.
"""

import textwrap
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from blocks import page_parser, table
from scipy.stats import kendalltau

import merge_cosim as mc
from merge_cosim.report.published import PUBLISHED

METHODS = ("acc", "slot", "ipcb", "pgm-g", "pgm", "pgm-symmetric")
COMPETITORS = METHODS[:-1]
"""The methods whose failure rates in Designed Test II were published."""
RULES = ("acc", "slot", "ipcb")
LIMITS = (12.0, 16.0, 20.0, 29.0)
LENGTHS = (4.0, 5.0, 7.0)
AHEAD = ("clear", "in-lane", "any")
ESTIMATORS = ("slot", "slot-time", "pgm", "pgm-symmetric", "pgm-g", "fg", "fg-gmm", "dbn-pf", "ipcb")
CONTROLLERS = ("acc", "lqr", "pcb", "rollout")
PICTURE = "img/ranking.png"
TEXT = """\
# What decides the order of the methods

{conclusion}

Made by `python tools/ranking_page.py`: Designed Test II in closed form, host's offset in steps of {step} m (n = {n} per
setting and method), model `us101-ngsim-all`. {settings} settings were tried, and all of them are shown: speed limit
{limits} m/s x length of both cars {lengths} m x meaning of 'the host is ahead' for the designed
merging car ({ahead}). The papers state none of the three. No default of the project was chosen
from this page.

## Failures over the open choices

![Failure rate of each method over speed limit and car length]({picture})

Failures in per cent; bold: the default. A row of maps per meaning of 'ahead', a column per method, all of one scale.

Kendall's tau compares the order of the {competitors} methods whose rates were published with the published order (1:
the same, -1: reversed).

{orders}
## Estimators and controllers apart

Failures and, in brackets, hosts that never arrived, in per cent, with the scenario's defaults. Down: the estimator;
across: the controller that drives on its estimate.

{apart}
{apart_words}
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweeps and write the page and its picture."""
    given = page_parser(__doc__).parse_args(argv)
    step = 5 if given.short else 2
    limits, lengths, ahead = (LIMITS[::3], LENGTHS[:2], AHEAD[:1]) if given.short else (LIMITS, LENGTHS, AHEAD)
    grid = {"encounters.host_offset.step": step} | (
        {"encounters.host_speed.step": 8, "encounters.merging_speed.step": 8} if given.short else {}
    )
    parts = []
    for setting in product(ahead, limits, lengths):
        choice = dict(zip(("merging.ahead", "speed_limit", "encounters.length"), setting, strict=True))
        parts.append(swept(METHODS, grid | choice).assign(**{name.rpartition(".")[2]: v for name, v in choice.items()}))
    rows = pd.concat(parts)
    published = {method: PUBLISHED["designed-2"][method].failure_pct for method in COMPETITORS}
    orders = taus(rows, published)
    draw(rows, given.docs / PICTURE)
    controllers = CONTROLLERS[:2] if given.short else CONTROLLERS
    estimators = ESTIMATORS[:2] if given.short else ESTIMATORS
    pairs = [f"{estimator}+{controller}" for estimator in estimators for controller in controllers]
    apart = swept(pairs, grid).set_index("method")
    text = TEXT.format(
        conclusion=conclusion(rows, orders, published),
        step=step,
        n=f"{int(rows['n'].max()):,}",
        settings=len(orders),
        limits=", ".join(f"{v:g}" for v in limits),
        lengths=", ".join(f"{v:g}" for v in lengths),
        ahead=", ".join(f"`{v}`" for v in ahead),
        picture=PICTURE,
        competitors=len(published),
        orders=order_table(orders),
        apart=table(
            ["estimator", *controllers],
            [[e, *(cell(apart.loc[f"{e}+{c}"]) for c in controllers)] for e in estimators],
        ),
        apart_words=apart_words(apart),
    )
    (given.docs / "ranking.md").write_text(text, encoding="utf-8")


def swept(methods: Sequence[str], settings: dict[str, object]) -> pd.DataFrame:
    """The summary of a sweep of Designed Test II."""
    results = mc.sweep("designed-2", list(methods), settings=settings, world="closed-form", jobs=1, progress=False)
    return results.summary()


def taus(rows: pd.DataFrame, published: dict[str, float]) -> pd.DataFrame:
    """Kendall's tau with the published order, per setting, and whether the order is the published one."""
    found = []
    for setting, here in rows.groupby(["ahead", "speed_limit", "length"], sort=False):
        rates = here.set_index("method")["failure_pct"][list(published)]
        tau = float(kendalltau(rates, list(published.values())).statistic)
        best = ", ".join(rates.index[rates == rates.min()])
        found.append((*setting, 0.0 if np.isnan(tau) else tau, best))
    return pd.DataFrame(found, columns=["ahead", "speed_limit", "length", "tau", "best"])


def conclusion(rows: pd.DataFrame, orders: pd.DataFrame, published: dict[str, float]) -> str:
    """What the settings show, in a paragraph."""
    same, lead = int((orders["tau"] > 0.999).sum()), orders["best"].value_counts()
    by_setting = rows.pivot(index=["ahead", "speed_limit", "length"], columns="method", values="failure_pct")
    rules = pd.Series(published)[list(RULES)]
    nearest = (by_setting[list(RULES)] - rules).abs().sum(axis=1).idxmin()
    theirs = ", ".join(f"{who} {by_setting.loc[nearest, who]:.1f} % ({rate:g} %)" for who, rate in published.items())
    return textwrap.fill(
        "**The rates in Designed Test II depend on choices that the papers do not state more than on the method.** The "
        f"published order appears in {same} of {len(orders)} settings; Kendall's tau with it goes from "
        f"{orders['tau'].min():.2f} to {orders['tau'].max():.2f}. The methods that learn nothing ({', '.join(RULES)}) "
        f"come nearest to their published rates with a limit of {nearest[1]:g} m/s, cars of {nearest[2]:g} m and ahead "
        f"`{nearest[0]}`; published rates in brackets: {theirs}. Fewest failures of these {len(published)}, by number "
        "of settings: "
        + "; ".join(f"{who} {count}" for who, count in lead.items())
        + ". How much depends on the cars that trained a model is on another page ([models](models.md)).",
        120,
    )


def order_table(orders: pd.DataFrame) -> str:
    """Tau and the best methods, per setting."""
    return table(
        ["ahead", "limit [m/s]", "length [m]", "tau", "fails least"],
        [[o.ahead, f"{o.speed_limit:g}", f"{o.length:g}", f"{o.tau:.2f}", o.best] for o in orders.itertuples()],
    )


def apart_words(apart: pd.DataFrame) -> str:
    """How far the rates go, from estimator to estimator and from controller to controller."""
    names = apart.index.str.partition("+")
    rates = pd.Series(
        apart["failure_pct"].to_numpy(),
        index=pd.MultiIndex.from_arrays([names.get_level_values(0), names.get_level_values(2)]),
    ).unstack()
    return textwrap.fill(
        "Under one controller the estimators' rates span "
        + ", ".join(f"{rates[c].max() - rates[c].min():.2f} points (`{c}`)" for c in rates)
        + "; where that is next to nothing, the test measures the controller and not the estimate.",
        120,
    )


def cell(row: pd.Series) -> str:
    """Failure rate and the share of hosts that never arrived."""
    stuck = 100 * row["host_not_reached"] / (row["n"] + row["censored"])
    return f"{row['failure_pct']:.2f}" + (f" ({stuck:.2f})" if stuck else "")


def draw(rows: pd.DataFrame, target: Path) -> None:
    """A heat map of failure rates per method and meaning of 'ahead'."""
    meanings = list(pd.unique(rows["ahead"]))
    size = (2.1 * len(METHODS) + 1, 2.6 * len(meanings) + 0.4)
    figure, axes = plt.subplots(
        len(meanings), len(METHODS), figsize=size, sharex=True, sharey=True, squeeze=False, layout="constrained"
    )
    top = max(1.0, float(rows["failure_pct"].max()))
    for (meaning, method), axis in zip(product(meanings, METHODS), axes.flat, strict=True):
        here = rows[(rows["ahead"] == meaning) & (rows["method"] == method)]
        rates = here.pivot(index="speed_limit", columns="length", values="failure_pct")
        image = axis.imshow(rates, origin="lower", aspect="auto", cmap="cividis_r", vmin=0, vmax=top)
        for (i, j), rate in np.ndenumerate(rates.to_numpy()):
            default = (rates.index[i], rates.columns[j]) == (29.0, 5.0)
            colour = "white" if rate > 0.55 * top else "black"
            axis.text(j, i, f"{rate:.1f}", ha="center", va="center", color=colour, weight="bold" if default else None)
        axis.set_xticks(range(rates.shape[1]), [f"{v:g}" for v in rates.columns])
        axis.set_yticks(range(rates.shape[0]), [f"{v:g}" for v in rates.index])
    for axis, method in zip(axes[0], METHODS, strict=True):
        axis.set_title(method)
    for axis, meaning in zip(axes[:, 0], meanings, strict=True):
        axis.set_ylabel(f"ahead: {meaning}\nspeed limit [m/s]")
    figure.supxlabel("length of both cars [m]", fontsize="medium")
    figure.colorbar(image, ax=axes, label="failures [%]", shrink=0.8)
    target.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(target, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()

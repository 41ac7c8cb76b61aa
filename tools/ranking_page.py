"""Write docs/ranking.md: which of the choices that the papers leave open decide the order of the methods.

    python tools/ranking_page.py

sweeps Designed Test II in closed form for every combination of speed limit, car length and meaning of 'ahead', for
several weights of iPCB's planner and several training sets, and every estimator under every controller; draws heat maps
of every method and counts where the published order appears.
"""

import textwrap
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from blocks import fill_page, page_parser, table
from scipy.stats import kendalltau

import merge_cosim as mc
from merge_cosim.report.published import PUBLISHED

RULES = ("acc", "slot", "ipcb")
LEARNED = ("pgm-g", "pgm", "pgm-symmetric")
COMPETITORS = (*RULES, *LEARNED[:-1])
"""The methods whose failure rates in Designed Test II were published."""
WEIGHTS = (10.0, 1.0, 0.0)
"""Weights of closeness in iPCB's planner; first the default."""
MODELS = ("us101-ngsim-all", "us101-ngsim", "us101-surrogate")
"""The project's own models: trained on all real cars (the default), on a third of them, on the surrogate."""
LIMITS = (12.0, 16.0, 20.0, 29.0)
LENGTHS = (4.0, 5.0, 7.0)
AHEAD = ("clear", "in-lane", "any")
ESTIMATORS = ("slot", "slot-time", "pgm", "pgm-symmetric", "pgm-g", "fg", "fg-gmm", "dbn-pf", "ipcb")
CONTROLLERS = ("acc", "lqr", "pcb", "rollout")
SETTING = ["ahead", "speed_limit", "length"]
OWN = ["weight", "model"]
PICTURES = {"img/ranking.png": RULES, "img/ranking-learned.png": LEARNED}
SETTINGS = """\
Made by `python tools/ranking_page.py`: Designed Test II in closed form, host's offset in steps of {step} m, both
speeds in steps of {step} m/s (n = {n} per setting and method). {settings} settings were tried,
and all of them are shown: speed limit {limits} m/s x length of both cars {lengths} m x meaning of
'the host is ahead' for the designed merging car ({ahead}) x weight of closeness
in iPCB's planner {weights} x training set ({models}; see [models](models.md)).
The papers state none of the five. No default of the project was chosen from this page.
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweeps and write the page and its picture."""
    given = page_parser(__doc__).parse_args(argv)
    step = 8 if given.short else 2
    limits, lengths, ahead = (LIMITS[::3], LENGTHS[:1], AHEAD[:1]) if given.short else (LIMITS, LENGTHS, AHEAD)
    grid: dict[str, object] = {
        f"encounters.{axis}.step": step for axis in ("host_offset", "host_speed", "merging_speed")
    }
    weights, models = (WEIGHTS[:2], MODELS[:2]) if given.short else (WEIGHTS, MODELS)
    parts = []
    for setting in product(ahead, limits, lengths):
        choice = dict(zip(("merging.ahead", "speed_limit", "encounters.length"), setting, strict=True))
        found = [swept(RULES[:-1], grid | choice)]
        found += [swept(RULES[-1:], grid | choice | {"pcb.closeness": w}).assign(weight=w) for w in weights]
        found += [swept(LEARNED, grid | choice, model).assign(model=model) for model in models]
        parts.append(pd.concat(found).assign(**dict(zip(SETTING, setting, strict=True))))
    rows = pd.concat(parts)
    published = {method: PUBLISHED["designed-2"][method].failure_pct for method in COMPETITORS}
    orders = taus(rows, published, weights, models)
    for picture, methods in PICTURES.items():
        draw(rows[rows["method"].isin(methods)], given.docs / picture)
    controllers = CONTROLLERS[:2] if given.short else CONTROLLERS
    estimators = ESTIMATORS[:2] if given.short else ESTIMATORS
    pairs = [f"{estimator}+{controller}" for estimator in estimators for controller in controllers]
    apart = swept(pairs, grid).set_index("method")
    tried = SETTINGS.format(
        step=step,
        n=f"{int(rows['n'].max()):,}",
        settings=len(orders),
        limits=", ".join(f"{v:g}" for v in limits),
        lengths=", ".join(f"{v:g}" for v in lengths),
        ahead=", ".join(f"`{v}`" for v in ahead),
        weights=", ".join(f"{v:g}" for v in weights),
        models=", ".join(f"`{v}`" for v in models),
    )
    cells = [[e, *(cell(apart.loc[f"{e}+{c}"]) for c in controllers)] for e in estimators]
    blocks = {
        "conclusion": conclusion(orders, published) + "\n",
        "settings": tried,
        "orders": order_table(orders),
        "apart": table(["estimator", *controllers], cells) + f"\n{apart_words(apart)}\n",
    }
    fill_page("ranking.md", given.docs, {"ranking": blocks.get})


def swept(methods: Sequence[str], settings: dict[str, object], model: str | None = None) -> pd.DataFrame:
    """The failure rates of a sweep of Designed Test II; the model is that of the designed tests if none is given."""
    results = mc.sweep(
        "designed-2",
        list(methods),
        model=model,
        settings=settings,
        world="closed-form",
        jobs=1,
        traces=0,
        progress=False,
    )
    columns = ["method", "n", "censored", "host_not_reached", "failure_pct"]
    return results.summary()[columns].assign(weight=np.nan, model="")


def taus(
    rows: pd.DataFrame, published: dict[str, float], weights: Sequence[float], models: Sequence[str]
) -> pd.DataFrame:
    """Kendall's tau with the published order, per setting, the methods that fail least, and the failure rates."""
    found = []
    for setting, here in rows.groupby(SETTING, sort=False):
        for weight, model in product(weights, models):
            own = here["weight"].isin([weight]) | (here["model"] == model) | here["method"].isin(RULES[:-1])
            rates = here[own].set_index("method")["failure_pct"][list(published)]
            tau = float(kendalltau(rates, list(published.values())).statistic)
            best = ", ".join(rates.index[rates == rates.min()])
            found.append((*setting, weight, model, 0.0 if np.isnan(tau) else tau, best, *rates))
    return pd.DataFrame(found, columns=[*SETTING, *OWN, "tau", "best", *published])


def conclusion(orders: pd.DataFrame, published: dict[str, float]) -> str:
    """What the settings show, in a paragraph."""
    same, best = int((orders["tau"] > 0.999).sum()), orders["best"].str.split(", ").explode()
    off = orders[list(published)] - pd.Series(published)
    rules = orders.loc[off[list(RULES)].abs().sum(axis=1).idxmin()]
    every = orders.loc[off.abs().sum(axis=1).idxmin()]
    theirs = ", ".join(f"{who} {rate:g} %" for who, rate in published.items())
    return textwrap.fill(
        "**The rates in Designed Test II depend on choices that the papers do not state more than on the method.** The "
        f"published order ({theirs}) appears in {same} of {len(orders)} settings; Kendall's tau with it goes from "
        f"{orders['tau'].min():.2f} to {orders['tau'].max():.2f}. The methods that learn nothing ({', '.join(RULES)}) "
        f"come nearest to their published rates with {words(rules, published)}. All {len(published)} together come "
        f"nearest with {words(every, published)}. No other of them fails less often, ties counted for each: "
        + ", ".join(f"{who} in {count} settings" for who, count in best.value_counts().items())
        + ". How much depends on the cars that trained a model is on another page ([models](models.md)).",
        120,
    )


def words(setting: pd.Series, published: dict[str, float]) -> str:
    """A setting and its failure rates."""
    rates = ", ".join(f"{who} {setting[who]:.1f}" for who in published)
    return (
        f"a limit of {setting['speed_limit']:g} m/s, cars of {setting['length']:g} m, ahead `{setting['ahead']}`, "
        f"weight {setting['weight']:g} and `{setting['model']}` ({rates} %)"
    )


def order_table(orders: pd.DataFrame) -> str:
    """Tau per setting, a column per choice of the methods' own."""
    wide = orders.pivot_table("tau", SETTING, OWN, sort=False)
    return table(
        ["ahead", "limit [m/s]", "length [m]", *(f"{weight:g}, `{model}`" for weight, model in wide.columns)],
        [
            [s[0], f"{s[1]:g}", f"{s[2]:g}", *(f"{tau:.2f}" for tau in taus)]
            for s, taus in zip(wide.index, wide.to_numpy(), strict=True)
        ],
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
    """Heat maps of failure rates: a column per method and choice of its own, a row per meaning of 'ahead'."""
    meanings = list(pd.unique(rows["ahead"]))
    order = rows["method"].map({method: place for place, method in enumerate((*RULES, *LEARNED))})
    columns = list(
        rows.assign(order=order).sort_values("order", kind="stable").groupby(["method", *OWN], sort=False, dropna=False)
    )
    size = (1.5 * len(columns) + 1.2, 2.4 * len(meanings) + 0.5)
    figure, axes = plt.subplots(
        len(meanings), len(columns), figsize=size, sharex=True, sharey=True, squeeze=False, layout="constrained"
    )
    top = max(1.0, float(rows["failure_pct"].max()))
    for (meaning, ((_, weight, model), part)), axis in zip(product(meanings, columns), axes.flat, strict=True):
        here = part[part["ahead"] == meaning]
        rates = here.pivot(index="speed_limit", columns="length", values="failure_pct")
        image = axis.imshow(rates, origin="lower", aspect="auto", cmap="cividis_r", vmin=0, vmax=top)
        usual = meaning == AHEAD[0] and model in ("", MODELS[0]) and not weight < WEIGHTS[0]
        for (i, j), rate in np.ndenumerate(rates.to_numpy()):
            default = usual and (rates.index[i], rates.columns[j]) == (29.0, 5.0)
            colour = "white" if rate > 0.55 * top else "black"
            axis.text(j, i, f"{rate:.1f}", ha="center", va="center", color=colour, weight="bold" if default else None)
        axis.set_xticks(range(rates.shape[1]), [f"{v:g}" for v in rates.columns])
        axis.set_yticks(range(rates.shape[0]), [f"{v:g}" for v in rates.index])
    for axis, ((method, weight, model), _) in zip(axes[0], columns, strict=True):
        own = model or (f"weight {weight:g}" if weight >= 0 else "")
        axis.set_title(f"{method}\n{own}", fontsize="small")
    for axis, meaning in zip(axes[:, 0], meanings, strict=True):
        axis.set_ylabel(f"ahead: {meaning}\nspeed limit [m/s]")
    figure.supxlabel("length of both cars [m]", fontsize="medium")
    figure.colorbar(image, ax=axes, label="failures [%]", shrink=0.8)
    target.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(target, dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    main()

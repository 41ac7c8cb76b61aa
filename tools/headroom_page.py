"""How far each method is from a host that knows the driver: python tools/headroom_page.py [--data DIR].

Fills the blocks `<!-- headroom: SCENARIO -->` ... `<!-- end -->` of docs/tests.md and draws the share of cases by delay
beyond that host's. Without --data the block of logged cars stays as it is.
"""

import textwrap
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from blocks import fill_page, page_parser, table
from model_flips import paragraph, under_models, what_flips

import merge_cosim as mc
from merge_cosim.report.methods import looks
from merge_cosim.studies.bounds import MOST_DELAY

METHODS = ["acc", "slot", "slot-time", "pgm", "pgm-symmetric", "fg-gmm", "dbn-pf", "ipcb", "interactive"]
REFERENCES = ["oracle-label", "oracle-best"]
LOGGED = ["us101-replay"]
NEAR = 0.5
"""Delay beyond the clairvoyant host's [s] that counts as near."""


def compared(scenario: str, data: Path | None, short: bool) -> pd.DataFrame:
    """Result rows with the bounds of their cases, and `beyond_s`, the delay beyond that of the path found."""
    settings: dict[str, Any] = {"encounters.count": 40} if short else {}
    source = {"data": data, "source": "ngsim"} if scenario in LOGGED else {}
    bounds, _ = mc.bounds(scenario, settings=settings, **source)
    methods = METHODS[:3] if short else [*METHODS, *REFERENCES]
    done = mc.sweep(scenario, methods, settings=settings, world="closed-form", jobs=1, progress=False, **source)
    columns = ["case", "min_delay_s", "found_delay_s", "by_throttle"]
    rows = done.rows[done.rows["method"].isin(methods)].merge(bounds[columns], on="case", validate="many_to_one")
    return rows.assign(beyond_s=rows["delay_s"] - rows["found_delay_s"])


def block(data: Path | None, short: bool, docs: Path, scenario: str) -> str | None:
    """The table of a scenario, and its picture; None where its data are absent."""
    if scenario in LOGGED and data is None:
        return None
    rows = compared(scenario, data, short)
    cases = rows.drop_duplicates("case")
    searched = cases[~cases["by_throttle"]]
    picture = f"img/headroom-{scenario}.png"
    draw(rows, docs / picture)
    found, low = cases["found_delay_s"], cases["min_delay_s"]
    gap = (found - low).clip(lower=0)
    words = (
        f"{len(cases):,} cases. The clairvoyant host fails in {int(found.isna().sum())} and has a mean delay of "
        f"{found.mean():.2f} s. In {len(searched):,} cases a path was searched, in the others full throttle is the "
        f"fastest. The smallest delay lies below that of the path by {gap.mean():.2f} s at most in the mean "
        f"({gap.quantile(0.9):.2f} s in nine cases of ten, {gap.max():.2f} s in any)."
    )
    lines = [line(method, part) for method, part in sorted(rows.groupby("method"), key=lambda item: order(item[0]))]
    return "\n".join(
        [
            textwrap.fill(words, 120),
            "",
            f"![Share of cases by delay beyond the clairvoyant host's]({picture})",
            "",
            table(
                ["method", "failed or stuck %", "delay s", "beyond, mean s", "median s", f"within {NEAR:g} s %"], lines
            ),
        ]
    )


def order(method: str) -> int:
    """Place of a method in the table."""
    return [*METHODS, *REFERENCES].index(method)


def line(method: str, rows: pd.DataFrame) -> list[str]:
    """A method's row: of the cases that are not censored."""
    rows = rows[~rows["censored"]]
    bad = rows["failed"] | rows["stuck"]
    near = ~bad & (rows["beyond_s"] <= NEAR)
    values = [rows["delay_s"].mean(), rows["beyond_s"].mean(), rows["beyond_s"].median()]
    return [f"`{method}`", f"{100 * bad.mean():.2f}", *(f"{v:.2f}" for v in values), f"{100 * near.mean():.1f}"]


def draw(rows: pd.DataFrame, target: Path) -> None:
    """For each method the share of its cases that passed, by delay beyond the clairvoyant host's."""
    figure, axis = plt.subplots(figsize=(8, 4.4), layout="constrained")
    chosen = looks(rows["method"])
    for method, part in sorted(rows.groupby("method"), key=lambda item: order(item[0])):
        part = part[~part["censored"]]
        passed = np.sort(part.loc[~(part["failed"] | part["stuck"]), "beyond_s"])
        share = 100 * np.arange(1, len(passed) + 1) / max(len(part), 1)
        look = chosen[method]
        shape = {"color": look.color, "marker": look.mark, "markevery": 0.15, "ms": 5}
        axis.step(passed, share, look.line, where="post", label=method, **shape)
    axis.set(xlim=(-0.5, 3 * MOST_DELAY), ylim=(0, 101), xlabel="delay beyond the clairvoyant host's [s]")
    axis.set_ylabel("cases passed [%]")
    axis.grid(alpha=0.3)
    axis.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    target.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(target, dpi=110)
    plt.close(figure)


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the blocks."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, help="folder with real NGSIM files")
    given = parser.parse_args(argv)
    kinds = {"headroom": partial(block, given.data, given.short, given.docs), "models": partial(models, given.data)}
    fill_page("tests.md", given.docs, kinds)


def models(data: Path | None, scenario: str) -> str | None:
    """What of a scenario's table depends on the model; None without data, and for the blocks of another tool."""
    words = ["sweep", scenario, "--method", ",".join(METHODS), "--world", "closed-form"]
    found = under_models(words, data) if scenario == "designed-3" else None
    return None if found is None else paragraph(what_flips(found, "scenario"))


if __name__ == "__main__":
    main()

"""Write the tables of docs/sensors.md and of the shifted drivers in docs/tests.md, for drivers and errors not made for.

    python tools/robustness_page.py [--sensing DIR] [--shifted DIR] [--data DIR]

runs the two sweeps that the pages show, in the closed form, and sets their summaries into the pages' blocks. With the
NGSIM files in `--data` both are also run under ten models, each trained on another third of the cars, to see what
depends on them; `--models` and `--shifted-models` take the result folders of that. Without them those parts stay.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from blocks import fill_page, page_parser, swept, table
from model_flips import paragraph, under_models, what_flips

from merge_cosim.report.methods import in_order
from merge_cosim.results.statistics.ensemble import RANK

SENSING = (
    *("sweep", "designed-3", "--world", "closed-form", "--method", "acc,slot-time,pgm,ipcb"),
    *("--vary", "sensing.model=radar,camera,coarse", "--vary", "sensing.delay=0.1,0.3,0.5,1"),
    *("--vary", "sensing.station_sigma=1,3", "--vary", "sensing.speed_sigma=0.1,0.5,1"),
    *("--vary", "sensing.dropout=0.3"),
)
SHIFTED = ("sweep", "designed-3", "shifted", "--world", "closed-form", "--method", "acc,slot-time,pgm,ipcb,oracle-best")
LATE, NOISY = "sensing.delay=0.5", "sensing.speed_sigma=0.5"
"""Errors that the page's first lines tell."""
SHORT = ("--set", "encounters.count=8", "--jobs", "1", "--traces", "0")


def summary_of(words: Sequence[str], short: bool, folder: Path | None) -> pd.DataFrame:
    """Summary of the sweep, which is run unless its folder is given."""
    return pd.read_json(swept([*words, *(SHORT if short else ())], folder) / "summary.json")


def block(words: Sequence[str], summary: pd.DataFrame, row: str) -> str:
    """The command and its table: a row for each value of the column `row`, a column for each method."""
    shown = " ".join(("merge-cosim", *words)).replace(" --vary", " \\\n    --vary") + " --out OUT"
    methods = in_order(summary["method"])
    cells = summary.assign(cell=[_cell(one) for _, one in summary.iterrows()]).pivot(
        index=row, columns="method", values="cell"
    )
    lines = [[f"`{name}`" if name else "no error", *cells.loc[name, methods]] for name in dict.fromkeys(summary[row])]
    return f"```\n{shown}\n```\n\n{table([row, *methods], lines)}"


def _cell(one: pd.Series) -> str:
    return f"{one['failed_or_stuck_pct']:.2f} %, {one['delay_s']:.2f} s"


def in_short(summary: pd.DataFrame) -> str:
    """What the errors do, in a few sentences."""
    rates = summary.pivot(index="variation", columns="method", values=RANK)[list(in_order(summary["method"]))]

    def change(variation: str) -> str:
        return ", ".join(f"{name} {rates.at['', name]:.2f} to {rates.at[variation, name]:.2f} %" for name in rates)

    worst = " or ".join(f"`{name}`" for name in dict.fromkeys(rates.idxmax()))
    return paragraph(
        f"Hosts that fail or get stuck in `designed-3`, without an error and with the merging car seen 0.5 s late: "
        f"{change(LATE)}. With noise of 0.5 m/s in its speed: {change(NOISY)}. Of the errors tried ([table]"
        f"(#what-errors-do-in-designed-3)) the worst is {worst}."
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweeps, if need be, and write the tables."""
    parser = page_parser(__doc__)
    for name in ("sensing", "shifted"):
        parser.add_argument(f"--{name}", type=Path, help="result folder of this sweep, if it was run already")
    parser.add_argument("--data", type=Path, help="folder with real NGSIM files, to train models on")
    for name in ("models", "shifted-models"):
        parser.add_argument(f"--{name}", type=Path, help="result folder of this sweep under several models")
    given = parser.parse_args(argv)
    summary = summary_of(SENSING, given.short, given.sensing)
    models = under_models(SENSING, given.data, given.models)
    parts = {
        "sensing": block(SENSING, summary, "variation"),
        "short": in_short(summary),
        "models": None if models is None else paragraph(what_flips(models, "variation", "")),
    }
    fill_page("sensors.md", given.docs, {kind: lambda _, made=made: made for kind, made in parts.items()})
    shifted = block(SHIFTED, summary_of(SHIFTED, given.short, given.shifted), "scenario")
    models = under_models(SHIFTED, given.data, given.shifted_models)
    flips = None if models is None else paragraph(what_flips(models, "scenario", "designed-3"))
    fill_page(
        "tests.md",
        given.docs,
        {"shifted": lambda _: shifted, "models": lambda name: flips if name == "shifted" else None},
    )


if __name__ == "__main__":
    main()

"""Write the tables of docs/sensors.md and of the shifted drivers in docs/tests.md, for drivers and errors not made for.

    python tools/robustness_page.py [--sensing DIR] [--shifted DIR] [--data DIR | --models DIR]

runs the two sweeps that the pages show, in the closed form, and sets their summaries into the pages' blocks. With the
NGSIM files in `--data`, the sweep of the sensors is also run under ten models, each trained on another third of the
cars, to see what depends on them; `--models` takes its result folder. Without either that part of the page stays.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import pandas as pd
from blocks import fill_page, page_parser, table

from merge_cosim.cli.main import app
from merge_cosim.report.methods import in_order
from merge_cosim.results.statistics.ensemble import RANK, rivals
from merge_cosim.studies.training import train_ensemble

SENSING = (
    *("sweep", "designed-3", "--world", "closed-form", "--method", "acc,slot-time,pgm,ipcb"),
    *("--vary", "sensing.model=radar,camera,coarse", "--vary", "sensing.delay=0.1,0.3,0.5,1"),
    *("--vary", "sensing.station_sigma=1,3", "--vary", "sensing.speed_sigma=0.1,0.5,1"),
    *("--vary", "sensing.dropout=0.3"),
)
SHIFTED = ("sweep", "designed-3", "shifted", "--world", "closed-form", "--method", "acc,slot-time,pgm,ipcb,oracle-best")
LATE, NOISY = "sensing.delay=0.5", "sensing.speed_sigma=0.5"
"""Errors that the page's first lines tell."""
MODELS = 10
SHORT = ("--set", "encounters.count=8", "--jobs", "1")


def summary_of(words: Sequence[str], short: bool, folder: Path | None) -> pd.DataFrame:
    """Summary of the sweep, which is run unless its folder is given."""
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="robustness-")) / "out"
        app([*words, *(SHORT if short else ()), "--out", str(folder)], standalone_mode=False)
    return pd.read_json(folder / "summary.json")


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
    return _wrapped(
        f"Hosts that fail or get stuck in `designed-3`, without an error and with the merging car seen 0.5 s late: "
        f"{change(LATE)}. With noise of 0.5 m/s in its speed: {change(NOISY)}. Of the errors tried ([table]"
        f"(#what-errors-do-in-designed-3)) the worst is {worst}."
    )


def under_models(summary: pd.DataFrame) -> str:
    """Which orders of two methods, and which effects of an error, are not the same under every model."""
    models, errors = summary["model"].replace("", pd.NA).nunique(), summary["variation"].nunique()
    pairs = rivals(summary)
    flips = pairs[(pairs["first_better"] > 0) & (pairs["second_better"] > 0)]
    parts = [f"Under {models} models, each trained on another third of the real cars: "]
    for (first, second), rows in flips.groupby(["first", "second"]):
        counts = " to ".join(map(str, sorted({rows["first_better"].min(), rows["first_better"].max()})))
        parts.append(
            f"which of {first} and {second} fails or gets stuck less depends on the model in {len(rows)} of the "
            f"{errors} rows ({first} under {counts} of the {models}); "
        )
    parts.append(f"{'no other order' if len(flips) else 'no order'} of two methods depends on it. ")
    for method, rows in summary[summary["model"] != ""].groupby("method"):
        rates = rows.pivot(index="variation", columns="model", values=RANK)
        rises = (rates.sub(rates.loc[""]) > 0).sum(axis=1).drop("")
        mixed = [f"`{name}` ({count})" for name, count in rises.items() if 0 < count < models]
        if mixed:
            parts.append(f"{method} gets worse by these errors under some of the models only: {', '.join(mixed)}. ")
    return _wrapped("".join(parts))


def _wrapped(text: str) -> str:
    return fill(text, 120, break_on_hyphens=False, break_long_words=False) + "\n"


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweeps, if need be, and write the tables."""
    parser = page_parser(__doc__)
    for name in ("sensing", "shifted"):
        parser.add_argument(f"--{name}", type=Path, help="result folder of this sweep, if it was run already")
    parser.add_argument("--data", type=Path, help="folder with real NGSIM files, to train models on")
    parser.add_argument("--models", type=Path, help="result folder of the sensors under several models")
    given = parser.parse_args(argv)
    summary, models = summary_of(SENSING, given.short, given.sensing), None
    if given.data is not None:
        folder = Path(tempfile.mkdtemp(prefix="models-"))
        train_ensemble("us101", given.data, "ngsim", 0, folder, splits=MODELS)
        models = summary_of((*SENSING, "--model", str(folder)), given.short, None)
    elif given.models is not None:
        models = summary_of((), given.short, given.models)
    parts = {
        "sensing": block(SENSING, summary, "variation"),
        "short": in_short(summary),
        "models": None if models is None else under_models(models),
    }
    fill_page("sensors.md", given.docs, {kind: lambda _, made=made: made for kind, made in parts.items()})
    shifted = block(SHIFTED, summary_of(SHIFTED, given.short, given.shifted), "scenario")
    fill_page("tests.md", given.docs, {"shifted": lambda _: shifted})


if __name__ == "__main__":
    main()

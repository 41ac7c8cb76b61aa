"""Write the tables of docs/sensors.md and of the shifted drivers in docs/tests.md, for drivers and errors not made for.

    python tools/robustness_page.py [--sensing DIR] [--shifted DIR]

runs the two sweeps that the pages show, in the closed form, and sets their summaries into the pages' blocks.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from blocks import fill_page, page_parser, table

from merge_cosim.cli.main import app
from merge_cosim.report.methods import in_order

SENSING = (
    *("sweep", "designed-3", "--world", "closed-form", "--method", "acc,slot-time,pgm,ipcb"),
    *("--vary", "sensing.model=radar,camera,coarse", "--vary", "sensing.delay=0.1,0.3,0.5,1"),
    *("--vary", "sensing.station_sigma=1,3", "--vary", "sensing.speed_sigma=0.1,0.5,1"),
    *("--vary", "sensing.dropout=0.3"),
)
SHIFTED = ("sweep", "designed-3", "shifted", "--world", "closed-form", "--method", "acc,slot-time,pgm,ipcb,oracle-best")
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


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweeps, if need be, and write the tables."""
    parser = page_parser(__doc__)
    for name in ("sensing", "shifted"):
        parser.add_argument(f"--{name}", type=Path, help="result folder of this sweep, if it was run already")
    given = parser.parse_args(argv)
    sensing = block(SENSING, summary_of(SENSING, given.short, given.sensing), "variation")
    fill_page("sensors.md", given.docs, {"sensing": lambda _: sensing})
    shifted = block(SHIFTED, summary_of(SHIFTED, given.short, given.shifted), "scenario")
    fill_page("tests.md", given.docs, {"shifted": lambda _: shifted})


if __name__ == "__main__":
    main()

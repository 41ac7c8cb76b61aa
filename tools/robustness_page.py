"""Write the tables of docs/sensors.md: how methods bear what they were not made for.

    python tools/robustness_page.py [--from DIR]

runs the sweep that the page shows, in the closed form, and sets its summary into the page's block.
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
SHORT = ("--set", "encounters.count=8", "--jobs", "1")


def summary_of(words: Sequence[str], short: bool, folder: Path | None) -> pd.DataFrame:
    """Summary of the sweep, which is run unless its folder is given."""
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="robustness-")) / "out"
        app([*words, *(SHORT if short else ()), "--out", str(folder)], standalone_mode=False)
    return pd.read_json(folder / "summary.json")


def block(words: Sequence[str], summary: pd.DataFrame, row: str, first: str) -> str:
    """The command and its table: a row for each value of the column `row`, a column for each method."""
    shown = " ".join(("merge-cosim", *words)).replace(" --vary", " \\\n    --vary") + " --out OUT"
    methods = in_order(summary["method"])
    cells = summary.assign(cell=[_cell(one) for _, one in summary.iterrows()]).pivot(
        index=row, columns="method", values="cell"
    )
    lines = [[f"`{name}`" if name else first, *cells.loc[name, methods]] for name in dict.fromkeys(summary[row])]
    return f"```\n{shown}\n```\n\n{table([row, *methods], lines)}"


def _cell(one: pd.Series) -> str:
    return f"{one['failed_or_stuck_pct']:.2f} %, {one['delay_s']:.2f} s"


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweep, if need be, and write the tables."""
    parser = page_parser(__doc__)
    parser.add_argument("--from", dest="folder", type=Path, help="result folder of the sweep, if it was run already")
    given = parser.parse_args(argv)
    made = block(SENSING, summary_of(SENSING, given.short, given.folder), "variation", "no error")
    fill_page("sensors.md", given.docs, {"sensing": lambda _: made})


if __name__ == "__main__":
    main()

"""Write the tables of docs/traffic.md: what each method does in living traffic.

    python tools/traffic_page.py [--from DIR ...]

runs one `merge-cosim sweep` of the three traffic scenarios (about a quarter of an hour on two cores) and sets its
summary, its table of the traffic as a whole, and what they say in short, into the page's blocks. With
`--from` it takes result folders of the same scenes under different methods instead.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import fill

import pandas as pd
from blocks import fill_page, page_parser, swept, table

from merge_cosim.report.methods import in_order
from merge_cosim.results.statistics.rates import wilson

SCENARIOS = ("traffic-light", "traffic-dense", "traffic-stop-and-go")
METHODS = ("acc", "slot", "slot-time", "pgm", "pgm-time", "fg-time", "ipcb", "ipcb+acc", "dbn-pf", "interactive")
BOUNDS = ("always-go", "always-yield")
SHORT = ("encounters.replications=1", "encounters.demand.duration=60", "encounters.demand.warm_up=10")
"""Settings of the short mode: one scene of a minute."""


def command(short: bool = False) -> list[str]:
    """The sweep; in short mode two methods on one scene of each scenario."""
    methods = ["--method", ",".join(("slot", BOUNDS[0]) if short else (*METHODS, *BOUNDS))]
    settings = [word for setting in SHORT if short for word in ("--set", setting)]
    return ["merge-cosim", "sweep", *SCENARIOS, *methods, *settings, *(["--jobs", "1"] if short else [])]


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweep, if need be, and write the tables."""
    parser = page_parser(__doc__)
    parser.add_argument("--from", dest="folders", nargs="+", type=Path, help="result folders, if run already")
    given = parser.parse_args(argv)
    folders = given.folders or [swept(command(given.short)[1:])]
    summary = pd.concat([pd.read_json(folder / "summary.json") for folder in folders])
    traffic = pd.concat([pd.read_csv(folder / "traffic.csv") for folder in folders])
    shown = (
        " ".join([*command(), "--out OUT"])
        .replace(" --method", " \\\n    --method", 1)
        .replace(" --out", " \\\n    --out")
    )
    parts = ["```", shown, "```", ""]
    parts.append(f"{int(traffic['scenes'].sum())} scenes.")
    parts += ["", "### All three together", "", together(summary, traffic)]
    for scenario in SCENARIOS:
        own = [rows[rows["scenario"] == scenario] for rows in (summary, traffic)]
        parts += [f"### {scenario}", "", by_method(*own)]
    made = "\n".join([*parts, ""])
    short = in_short(summary, traffic)
    fill_page("traffic.md", given.docs, {"tables": lambda _: made, "short": lambda _: short})


def in_short(summary: pd.DataFrame, traffic: pd.DataFrame) -> str:
    """What the tables say about the methods that estimate and decide, in a few sentences."""
    methods = [method for method in in_order(summary["method"]) if method not in BOUNDS]
    counts = summary.groupby("method")[["failures", "n"]].sum().astype(int).loc[methods]
    counts["low"], counts["high"] = zip(*map(wilson, counts["failures"], counts["n"]), strict=True)
    none, worst = counts[counts["failures"] == 0], counts.loc[counts["low"].idxmax()]
    parts = []
    if len(none):
        parts.append(
            f"No failure under {_listed(none.index)} in {none['n'].min()} to {none['n'].max()} meetings each: at most "
            f"{none['high'].max():.1f} % (Wilson 95 %). "
        )
    if worst["failures"]:
        apart = list(counts.index[counts["high"] < worst["low"]])
        parts.append(
            f"Most under {worst.name}, {worst['failures']:.0f} of {worst['n']:.0f} ({worst['low']:.1f}–"
            f"{worst['high']:.1f} %); "
        )
        parts.append(
            f"the intervals of {_listed(apart)} lie below that. " if apart else "no interval lies below that. "
        )
    stops = traffic.groupby("method")[["merging_stopped", "meetings"]].sum().loc[methods]
    share = (100 * stops["merging_stopped"] / stops["meetings"]).sort_values()
    parts.append(
        f"The merging car stops before it merges in {share.iloc[0]:.1f} % of the meetings under {share.index[0]}, in "
        f"{share.iloc[-1]:.1f} % under {share.index[-1]}. "
    )
    flow = traffic[traffic["method"].isin(methods)].groupby("scenario")["throughput_veh_h"].agg(["min", "max"])
    parts.append(
        f"Cars out per hour differ by at most {100 * (1 - flow['min'] / flow['max']).max():.1f} % by the method."
    )
    return fill("".join(parts), 120, break_on_hyphens=False) + "\n"


def _listed(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} and {last}" if most else last


def together(summary: pd.DataFrame, traffic: pd.DataFrame) -> str:
    """Failures, stopped merging cars and contacts of hosts, by method."""
    lines = []
    failures = summary.groupby("method")[["failures", "n"]].sum()
    whole = traffic.groupby("method")[["merging_stopped", "meetings", "host_contacts"]].sum().astype(int)
    for method in in_order(summary["method"]):
        failed, n = failures.loc[method]
        low, high = wilson(int(failed), int(n))
        one = whole.loc[method]
        stopped = f"{one['merging_stopped']} of {one['meetings']}"
        lines.append([method, f"{failed} of {n} ({low:.1f}–{high:.1f} %)", stopped, str(one["host_contacts"])])
    return table(["method", "failures of n (Wilson 95 %)", "merging car stopped", "contacts of hosts"], lines)


def by_method(summary: pd.DataFrame, traffic: pd.DataFrame) -> str:
    """One row per method: its meetings, and the traffic as a whole."""
    lines = []
    rows, whole = summary.set_index("method"), traffic.set_index("method")
    for method in in_order(summary["method"]):
        one, all_cars = rows.loc[method], whole.loc[method]
        failures = f"{one['failures']} of {one['n']} ({one['ci_low_pct']:.1f}–{one['ci_high_pct']:.1f} %)"
        cells = [
            method,
            failures,
            str(one["censored"]),
            *(f"{one[name]:.{digits}f}" for name, digits in MEASURES),
            f"{all_cars['merging_stopped']:.0f} of {all_cars['meetings']:.0f}",
            f"{all_cars['host_contacts']:.0f}",
            f"{all_cars['throughput_veh_h']:.0f}",
            f"{all_cars['time_loss_s']:.2f}",
        ]
        lines.append(cells)
    return table(HEAD, lines)


HEAD = (
    *("method", "failures of n (Wilson 95 %)", "censored", "D m", "delay s", "braking m/s²", "leader gap m"),
    *("follower gap m", "merging car stopped", "contacts of hosts", "cars out per h", "time lost s"),
)
MEASURES = (
    ("distance_m", 1),
    ("delay_s", 2),
    ("hardest_braking", 2),
    ("min_leader_gap_m_p05", 1),
    ("min_follower_gap_m_p05", 1),
)

if __name__ == "__main__":
    main()

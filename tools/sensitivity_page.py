"""Write docs/sensitivity.md: what each choice that the papers leave open does to the failure rates.

    python tools/sensitivity_page.py [--data DIR]

runs one `merge-cosim sweep` with a `--vary` per choice, in closed form where a method allows it, and sets its summary
out as tables, each row one value, each column one method, with what they show put into words by rule. With `--data` it
also runs Designed Test II with the defaults under models of other thirds of the cars; `--models` takes the result
folder of that.
"""

import shlex
import textwrap
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import pandas as pd
from blocks import page_parser, swept
from model_flips import under_models, what_flips

from merge_cosim.controllers.base import controllers
from merge_cosim.core.registry import parameters
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.scenarios.settings import parse_value

METHODS = ("acc", "slot", "slot-time", "pgm", "pgm-symmetric", "always-go", "always-yield")
RIVALS = ("acc", "slot", "slot-time", "pgm", "pgm-symmetric")
"""The methods whose order matters; the others are bounds."""
CHOICES = {
    "merging.ahead=clear,in-lane,any": "When the designed merging car takes the host to be ahead of it",
    "speed_limit=12,15,20,25,29,33": "Speed limit [m/s]: how fast a host drives with no car ahead",
    "acc.min_acceleration=-8,-6,-4,-3,-2": "Hardest braking of the host [m/s²]",
    "acc.max_acceleration=1,1.5,2,3,4": "Hardest acceleration of the host [m/s²]",
    "acc.headway=0.5:2.5:0.5": "Time headway of the host's distance keeping [s]",
    "acc.d0=0,1,2,4": "Gap at standstill [m]",
    "acc.k_gap=0.1,0.23,0.5": "Gain on the gap error [1/s²]",
    "test.horizon=0.5,1,2,3,5": "Time that is scored after both cars have reached the merging point [s]",
    "test.overlap_from=both,lane_change": "From when on an overlap counts",
    "encounters.length=4,5,6": "Length of both cars [m]",
    "encounters.rules.max_window=2,3,5.2,8": "Start of the window: at most this long before the lane change [s]",
    "encounters.merge_point=car,site": "Station 0 at each logged lane change, or at the site's median",
    "encounters.rules.observed=causal,raw": "What is observed of the merging car's speed",
}
WEAK = 0.5
"""Points below which a choice counts as one that hardly matters."""
SHORT = ("merging.ahead=any", "acc.d0=0")
"""Choices of the short mode, on a part of the grid alone."""
COARSE = ("host_offset.step=5", "host_speed.step=8", "merging_speed.step=8")
HEAD = """# Sensitivity to what the papers leave open

Failure rate in per cent by method, for each choice by itself, everything else as in the scenario file. The default
value is in bold. `designed-2` is the grid of Dong, Dolan, Litkouhi 2017; `us101-replay` rests on
{source}.
In brackets: the share of hosts that had not reached the merging point when the run ended, where there are any; a method
can lower one rate by raising the other. With `overlap_from=lane_change` a run is scored, and ends, sooner.

Made by

```
{command}
```

followed by `python tools/sensitivity_page.py --from {out}`.
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Run the sweep, if need be, and write the page."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, help="folder with NGSIM files")
    parser.add_argument("--from", dest="folder", type=Path, help="result folder of the sweep, if it was run already")
    parser.add_argument("--models", type=Path, help="result folder of designed-2 under several models")
    arguments = parser.parse_args(argv)
    choices = SHORT if arguments.short else tuple(CHOICES)
    words = ["merge-cosim", "sweep", "designed-2", *(() if arguments.short else ("us101-replay",))]
    words += [word for method in METHODS for word in ("--method", method)]
    words += [word for choice in choices for word in ("--vary", choice)]
    words += ["--world", "closed-form"]
    if arguments.short:
        words += ["--jobs", "1", *(word for step in COARSE for word in ("--set", f"encounters.{step}"))]
    data = ["--data", str(arguments.data)] if arguments.data else []
    folder = swept([*words[1:], *data], arguments.folder)
    rows = pd.read_json(folder / "summary.json", dtype={"variation": str})
    real = (rows.loc[rows["scenario"] == "us101-replay", "source"] == "ngsim").all()
    source = "real NGSIM data (fragments and merging episodes)" if real else "the SYNTHETIC surrogate"
    command = " ".join(shlex.quote(word) for word in [*words, *(["--data", "DIR"] if real else []), "--out", "OUT"])
    parts = [HEAD.format(source=source, command=command.replace(" --", " \\\n    --"), out="OUT")]
    usual = ["sweep", "designed-2", "--method", ",".join(RIVALS), "--world", "closed-form"]
    models = under_models(usual, arguments.data, arguments.models)
    parts.append(findings(rows, models))
    titles = {choice.partition("=")[0]: title for choice, title in CHOICES.items()}
    parts += [section(rows, name, titles[name]) for name in (choice.partition("=")[0] for choice in choices)]
    (arguments.docs / "sensitivity.md").write_text("\n".join(parts), encoding="utf-8")


def section(rows: pd.DataFrame, name: str, title: str) -> str:
    """One choice: a table per scenario that knows it."""
    lines = [f"## {title}", "", f"`{name}`", ""]
    for scenario, here in rows.groupby("scenario"):
        varied = here[here["variation"].str.startswith(f"{name}=")]
        if varied.empty:
            continue
        default = here[here["variation"] == ""].set_index("method")
        cells = varied.assign(cell=varied.apply(cell, axis=1), value=varied["variation"].str.partition("=")[2])
        table = cells.pivot(index="value", columns="method", values="cell").reindex(pd.unique(cells["value"]))
        methods = [method for method in METHODS if method in table]
        lines += [f"**{scenario}** (n = {int(default['n'].max())})", ""]
        lines += [f"| {name.rpartition('.')[2]} | " + " | ".join(methods) + " |", "|---" * (len(methods) + 1) + "|"]
        found = default_value(str(scenario), name)
        usual = "no limit" if found is None else parse_value(str(found))
        if usual not in map(parse_value, table.index):
            table = pd.concat([pd.DataFrame(default.apply(cell, axis=1).rename(str(usual))).T, table])
        for value in table.index:
            shown = f"**{value}**" if parse_value(value) == usual else value
            lines.append(f"| {shown} | " + " | ".join(table.loc[value, methods]) + " |")
        lines.append("")
    return "\n".join(lines)


def default_value(scenario: str, name: str) -> object:
    """What a scenario has for a choice when nothing is set."""
    owner, _, parameter = name.rpartition(".")
    if owner in controllers:
        return parameters(controllers[owner])[parameter]
    loaded = load_scenario(scenario)
    if name == "speed_limit":
        return loaded.speed_limit or Ramp.load(loaded.ramp).speed_limit
    if owner == "merging":
        return getattr(loaded.merging_car(), parameter)
    found: object = loaded
    for part in name.split("."):
        found = getattr(found, part)
    return found


def findings(rows: pd.DataFrame, models: pd.DataFrame | None = None) -> str:
    """What the tables show: the order of the methods, what turns it round, and which choice moves the rates most."""
    lines = ["## What it shows", ""]
    for scenario, here in rows[rows["method"].isin(RIVALS)].groupby("scenario"):
        rates = here.pivot(index="variation", columns="method", values="failure_pct")[list(RIVALS)]
        default = rates.loc[""]
        order = ", ".join(f"{method} {rate:.1f} %" for method, rate in default.sort_values(kind="stable").items())
        lines.append(f"- **{scenario}**, with the defaults: {order}.")
        lines[-1] += f" One case more or less is {100 / here['n'].max():.2g} points."
        if models is not None and (models["scenario"] == scenario).all():
            lines.append(f"- This is under one model. {what_flips(models, 'scenario')}")
        varied = rates.drop(index="")
        turned = [variation for variation, row in varied.iterrows() if reversed_pairs(default, row)]
        lines.append(f"- The order of two methods is reversed by {grouped(turned) or 'no value at all'}.")
        for method in ("pgm", "pgm-symmetric"):
            best = [variation for variation, row in varied.iterrows() if row[method] < row.drop(method).min()]
            lines.append(f"- `{method}` fails least of all with {grouped(best) or 'no value at all'}.")
        name = varied.index.str.partition("=").get_level_values(0)
        span = (varied.groupby(name).max() - varied.groupby(name).min()).max(axis=1).sort_values(ascending=False)
        strong = ", ".join(f"`{choice}` {points:.1f}" for choice, points in span.head(3).items())
        weak = ", ".join(f"`{choice}`" for choice in span.index[span < WEAK])
        lines.append(
            f"- What moves a method's rate most, in points between two of its values: {strong}."
            + (f" Less than half a point: {weak}." if weak else "")
        )
    return "\n".join([*(textwrap.fill(line, 120, subsequent_indent="  ") for line in lines), ""])


def reversed_pairs(one: pd.Series, other: pd.Series) -> bool:
    """Whether some method fails more than another in the one, and less in the other."""
    return any((one[a] - one[b]) * (other[a] - other[b]) < 0 for a, b in combinations(RIVALS, 2))


def grouped(variations: list[str]) -> str:
    """Variations in words, the values of each choice together."""
    values: dict[str, list[str]] = {}
    for variation in variations:
        name, _, value = variation.partition("=")
        values.setdefault(name, []).append(value)
    return "; ".join(f"`{name}` {', '.join(of)}" for name, of in values.items())


def cell(row: pd.Series) -> str:
    """Failure rate, and the share of hosts that never arrived."""
    missed = 100 * row["host_not_reached"] / (row["n"] + row["censored"])
    shown = f"{missed:.1f}" if missed >= 0.05 else "<0.1"
    return f"{row['failure_pct']:.1f}" + (f" ({shown})" if missed else "")


if __name__ == "__main__":
    main()

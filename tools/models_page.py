"""Fill the blocks of docs/models.md: what the project's models were trained on, and how accurate they are.

    python tools/models_page.py --data DIR

trains each model anew into a scratch folder, by the function behind `merge-cosim train`, says whether the file that
comes with the project is the same byte by byte, and sets the judgement on held-out merging cars out as tables.
"""

import re
import tempfile
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from blocks import fill_page, page_parser
from blocks import table as markdown

from merge_cosim.core.encounter import Encounters, Intention
from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.model import MODELS, IntentionModel
from merge_cosim.results.store import ENSEMBLE_CSV, ResultFolder
from merge_cosim.scenarios.encounters import SourceChoice, pairs_of_site
from merge_cosim.scenarios.sources import Pairs
from merge_cosim.studies.training import train, train_ensemble
from merge_cosim.sweeps.sweep import SweepRequest, sweep

SPEAKS_FOR = {"YIELD": Intention.YIELD, "NOT_YIELD": Intention.NOT_YIELD}
SAME = """\
Made by `python tools/models_page.py --data DIR` with the NGSIM files in `DIR`. It trains every model again; {same}."""
READING = """\
- **Near the merging point the times to arrival determine the order**: all estimators that use them are right.
  Estimators can differ only further away.
- **Against a rule that learns nothing** (`slot-time`: the car with the shorter time to arrival goes first), more
  accurate by more than half a per cent are {better}.
- **The speed term (`pgm-speed`) has little to learn.** Each merging car is paired with the host ahead of it and with
  the host behind it: it yields in one pair, does not in the other, and its speeds are counted for both intentions.
  So do {both}. The two counts differ only through the cars that stand in one class, and through windows of different
  length. The reason is how the pairs are made, not the number of cars.
- **{frames} frames of real data are not as many independent observations**: those of one car are nearly alike. With
  {cars} cars, differences of a few per cent between estimators remain undecided.
- Both cars drive as logged. A host that acts on the estimates gets into other situations than these."""
REAL = {"ngsim": "real data", "surrogate": "surrogate"}
LEARNED = (
    *("pgm", "pgm-symmetric", "pgm-time", "pgm-speed", "pgm-g"),
    *("fg", "fg-time", "fg-gmm", "fg-gmm-time", "dbn-pf", "ipcb"),
)
"""Methods that learn from data."""
RULE = "slot-time"
"""The rule that the learned estimators are held against."""


def shared(encounters: Encounters) -> tuple[int, int]:
    """How many merging cars there are, and how many of them stand in both classes."""
    labels: dict[str, set[int]] = {}
    for car, label in zip(encounters.car, encounters.label, strict=True):
        labels.setdefault(str(car), set()).add(int(label))
    return len(labels), sum(len(one) == len(SPEAKS_FOR) for one in labels.values())


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Accuracy and log loss, one row per estimator and one column per distance."""
    distances = list(dict.fromkeys(row["distance_m"] for row in rows))
    frames = {row["distance_m"]: row["frames"] for row in rows}
    head = ["accuracy % (log loss)", *(f"{d.replace('-inf', ' and more')} m" for d in distances)]
    lines = [["frames", *(f"{frames[d]:,}" for d in distances)]]
    for name in dict.fromkeys(row["estimator"] for row in rows):
        of = {row["distance_m"]: row for row in rows if row["estimator"] == name}
        cells = [
            f"{of[d]['accuracy_pct']:.1f}" + ("" if of[d]["log_loss"] is None else f" ({of[d]['log_loss']:.3f})")
            if d in of
            else ""
            for d in distances
        ]
        lines.append([f"`{name}`", *cells])
    return markdown(head, lines).rstrip()


def better(name: str, rows: Sequence[dict[str, Any]]) -> list[str]:
    """Where an estimator is more accurate than the rule that learns nothing, in words."""
    rule = {row["distance_m"]: row["accuracy_pct"] for row in rows if row["estimator"] == RULE}
    return [
        f"`{row['estimator']}` of {name} at {row['distance_m'].replace('-inf', ' and more')} m "
        f"({row['accuracy_pct']:.1f} against {rule[row['distance_m']]:.1f} %)"
        for row in rows
        if row["accuracy_pct"] > rule[row["distance_m"]] + 0.5
    ]


def wrapped(text: str) -> str:
    """Paragraphs and list items broken at 120 characters; tables, code and headings as they are."""
    lines = []
    for block in re.split(r"\n(?=\n|- )", text):
        plain = not re.match(r"\n*(\||#| {4})", block)
        indent = "  " if block.lstrip("\n").startswith("- ") else ""
        gap = "\n" * (len(block) - len(block.lstrip("\n")))
        lines.append(gap + textwrap.fill(" ".join(block.split()), 120, subsequent_indent=indent) if plain else block)
    return "\n".join(lines)


def section(model: IntentionModel, report: dict[str, Any], trained: Encounters) -> str:
    """One model: its command, its training pairs, its judgement."""
    where = " --data DIR" if model.source == "ngsim" else ""
    everything = model.settings["fraction"] == 1.0
    settings = " --all" if everything else f" --split {model.settings['split']} --seed {model.settings['seed']}"
    yielding, other = (int(model.pairs[i]) for i in SPEAKS_FOR.values())
    cars, both = shared(trained)
    rests = {
        "ngsim": "real NGSIM data: published fragments of US-101 (mostly 07:50 to 08:05), and merging episodes derived "
        "from NGSIM, not a complete period",
        "surrogate": "the SYNTHETIC [surrogate](surrogate.md), SUMO's own traffic; "
        "it is no evidence about human drivers",
    }[model.source]
    return f"""## {model.name}

    merge-cosim train --site {model.site} --source {model.source}{where}{settings} --out {model.name}.json

Rests on {rests}. Trained on {report["train_pairs"]} pairs of {report["train_cars"]} merging cars ({yielding} pairs
YIELD, {other} NOT_YIELD; {both} of the {cars} cars stand in both classes), {judged(model, report)}
"""


def judged(model: IntentionModel, report: dict[str, Any]) -> str:
    """Which share of the cars it was trained on, and how it does on the others."""
    if not report["test_pairs"]:
        return "all cars, so that none is left to judge it on. The tests without real pairs take it."
    return f"""one third of the cars, drawn by seed
{model.settings["seed"]}. Judged on {report["test_pairs"]} pairs of the other {report["test_cars"]} cars:

{table(report["held_out"])}"""


def spread(data: Path, short: bool) -> dict[str, str]:
    """How much of each method's result hangs on the cars that trained it, by splits and by folds."""
    models = 2 if short else 10
    parts = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        train_ensemble("us101", data, "ngsim", 0, folder / "splits", splits=models)
        train_ensemble("us101", data, "ngsim", 0, folder / "folds", folds=models)
        base = SweepRequest((), LEARNED[:1] if short else LEARNED, data=data, source="ngsim", world="closed-form")
        grid = {"encounters.host_offset.step": 10, "encounters.host_speed.step": 8} if short else {}
        everyone = {"encounters.sites": {"us101": "all"}}
        for name, chosen, settings in (("designed-2", "splits", grid), ("us101-replay", "folds", everyone)):
            request = replace(base, scenarios=[name], model=str(folder / chosen), settings=settings)
            sweep(request, folder / name)
            parts[chosen] = ensemble_table(ResultFolder(folder / name).table(ENSEMBLE_CSV))
    return parts


def ensemble_table(frame: pd.DataFrame) -> str:
    """One row per method: failures over all models, and the median and range over models."""
    lines = [
        [
            f"`{row['method']}`",
            f"{row['n']:,}",
            f"{row['failures']:,}",
            *(
                f"{row[f'{name}_median']:.2f} ({row[f'{name}_min']:.2f} to {row[f'{name}_max']:.2f})"
                for name in ("failure_pct", "failed_or_stuck_pct", "delay_s")
            ),
        ]
        for row in frame.to_dict("records")
    ]
    return markdown(["method", "runs", "failures", "failed %", "failed or stuck %", "delay s"], lines)


def judgement(data: Path, short: bool) -> dict[str, str]:
    """Train all models again: whether the files are the same, a section per model, and what these say."""
    sections, both, same, wins, frames, cars = [], [], [], [], 0, 0
    for file in sorted(MODELS.glob("*-ngsim.json" if short else "*.json")):  # the surrogate takes a minute
        model = IntentionModel.load(file)
        source: SourceChoice = "ngsim" if model.source == "ngsim" else "surrogate"
        split, seed = model.settings["split"], model.settings["seed"]
        with tempfile.TemporaryDirectory() as scratch:
            again = Path(scratch) / file.name
            report = train(model.site, data, source, split, seed, again, model.settings["fraction"] == 1.0)
            same.append(again.read_bytes() == file.read_bytes())
        rules = Pairs.model_validate({"kind": "pairs", "sites": {model.site: "all"}, "split": split, "seed": seed})
        pairs = pairs_of_site(model.site, rules, data, source)
        if not set(model.trained_on) <= set(pairs.car.astype(str)):
            raise UserError(f"{file}: was trained on cars that {data} does not hold")
        trained = pairs.take(np.flatnonzero(np.isin(pairs.car.astype(str), model.trained_on)))
        sections.append(section(model, report, trained))
        wins += better(model.name, report["held_out"])
        everyone, in_both = shared(pairs)
        said_of = f"{in_both} of the {everyone} merging cars ({100 * in_both / everyone:.0f} %) of the {REAL[source]}"
        both += [said_of] if said_of not in both else []
        if source == "ngsim" and report["held_out"]:
            frames = sum({row["distance_m"]: row["frames"] for row in report["held_out"]}.values())
            cars = report["test_cars"]
    said = (
        "the files of the project came out the same, byte by byte" if all(same) else "NOT ALL FILES CAME OUT THE SAME"
    )
    reading = READING.format(both=" and ".join(both), better=", ".join(wins) or "none", frames=f"{frames:,}", cars=cars)
    texts = {"same": SAME.format(same=said), "each": "\n\n".join(map(str.strip, sections)), "reading": reading}
    return {name: wrapped(text) + "\n" for name, text in texts.items()}


def main(argv: Sequence[str] | None = None) -> None:
    """Train all models again and fill the blocks."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with real NGSIM files")
    given = parser.parse_args(argv)
    made = judgement(given.data, given.short) | spread(given.data, given.short)
    fill_page("models.md", given.docs, {"models": made.get})


if __name__ == "__main__":
    main()

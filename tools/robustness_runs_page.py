"""Set what the long commands have printed into docs/robustness.md.

python tools/fuzz.py --inputs 100000 --seed 14 > fuzz.json
python tests/ramps/corpus/drive.py > corpus.json
python tools/faults.py --faults 300 --seed 14 > faults.json
python tools/mutation.py --sample 25 > mutation.json
python tools/robustness_runs_page.py --fuzz fuzz.json --corpus corpus.json --faults faults.json --mutation mutation.json
"""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from blocks import fill_page, page_parser, table
from faults import FAULTS
from mutation import CORE

KINDS = ("right", "refused", "wrong", "traceback", "line", "hang", "crash", "process")


def fuzz(runs: Sequence[dict[str, Any]]) -> str:
    """The commands, and what became of each target's inputs in all of them."""
    stretches: list[list[int]] = []  # seed, first input and number of inputs; parts that follow each other are one
    for seed, first, inputs in sorted((run["seed"], run.get("first", 0), run["inputs"]) for run in runs):
        if stretches and stretches[-1][0] == seed and sum(stretches[-1][1:]) == first:
            stretches[-1][2] += inputs
        else:
            stretches.append([seed, first, inputs])
    commands = [f"python tools/fuzz.py --seed {s} --first {first} --inputs {inputs}" for s, first, inputs in stretches]
    counts = {name: Counter[str]() for run in runs for name in run["targets"]}
    for run in runs:
        for name, ends in run["targets"].items():
            counts[name].update(ends)
    found = [(name, ends) for name, ends in counts.items() if ends.total()]
    rows = [[name, *(f"{ends[kind]:,}" for kind in KINDS)] for name, ends in found]
    whole = sum(counts.values(), Counter[str]())
    rows.append(["**all**", *(f"**{whole[kind]:,}**" for kind in KINDS)])
    text = f"{whole.total():,} inputs."
    return "```\n" + "\n".join(commands) + f"\n```\n\n{text}\n\n{table(['target', *KINDS], rows)}"


def ramps(found: dict[str, Any]) -> str:
    """The command, and how many ramps of the corpus came out right."""
    text = f"{found['ramps']} ramps: {found['right']} right, {found['refused']} refused with the right reason"
    wrong = "".join(f"\n- {name}: {end}" for name, end in found["wrong"].items())
    listed = f", {len(found['wrong'])} wrong:\n{wrong}\n" if wrong else ", none wrong.\n"
    return f"```\npython tests/ramps/corpus/drive.py\n```\n\n{text}{listed}"


def faults(runs: Sequence[dict[str, Any]]) -> str:
    """The commands, and how the sweeps ended, by kind of fault."""
    commands = [f"python tools/faults.py --faults {run['faults']} --seed {run['seed']}{_only(run)}" for run in runs]
    ends = {name: Counter[str]() for run in runs for name in run["kinds"]}
    for run in runs:
        for name, found in run["kinds"].items():
            ends[name].update(found)
    whole = sum(ends.values(), Counter[str]())
    rows = [[f"`{name}`", str(found["same"]), str(found["wrong"])] for name, found in ends.items()]
    rows.append(["**all**", f"**{whole['same']}**", f"**{whole['wrong']}**"])
    return "```\n" + "\n".join(commands) + f"\n```\n\n{table(['fault', 'the same bytes', 'anything else'], rows)}"


def _only(run: dict[str, Any]) -> str:
    return f" --only {','.join(run['kinds'])}" if set(run["kinds"]) < {kind.__name__ for kind in FAULTS} else ""


def mutation(found: dict[str, Any]) -> str:
    """The command, the score of each part, and what survived."""
    most = max(part["run"] for part in found["parts"].values())
    only = f" --only {','.join(found['parts'])}" if len(found["parts"]) < len(CORE) else ""
    command = f"python tools/mutation.py --sample {most} --seed {found['seed']}{only} > mutation.json"
    rows = [[name, *(str(part[key]) for key in ("mutants", "run", "killed"))] for name, part in found["parts"].items()]
    low, high = found["interval_pct"]
    share = 100.0 * found["killed"] / found["run"]
    text = f"Killed: {found['killed']} of {found['run']}, {share:.1f} % (95 %: {low} to {high} %)."
    survived = [one for part in found["parts"].values() for one in part["survived"]]
    lived = "".join(f"\n- `{one.removeprefix('merge_cosim/')}`" for one in survived)
    listed = f"\nSurvived (module, line, change):\n{lived}\n" if survived else ""
    return f"```\n{command}\n```\n\n{table(['part', 'mutants', 'run', 'killed'], rows)}\n{text}\n{listed}"


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the blocks of which the output is given."""
    parser = page_parser(__doc__)
    parser.add_argument("--fuzz", type=Path, nargs="+", help="what the commands have printed")
    parser.add_argument("--again", type=Path, nargs="+", help="the same, of inputs that were faults before")
    parser.add_argument("--corpus", type=Path, help="what the command has printed")
    parser.add_argument("--faults", type=Path, nargs="+", help="what the commands have printed")
    parser.add_argument("--mutation", type=Path, help="what the command has printed")
    given = parser.parse_args(argv)
    made = {}
    for name, shown in (("fuzz", fuzz), ("again", fuzz), ("faults", faults)):
        if files := getattr(given, name):
            made[name] = shown([json.loads(file.read_text()) for file in files])
    for name, shown_one in (("corpus", ramps), ("mutation", mutation)):
        if file := getattr(given, name):
            made[name] = shown_one(json.loads(file.read_text()))
    fill_page("robustness.md", given.docs, {"runs": made.get})


if __name__ == "__main__":
    main()

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

from merge_cosim.results.statistics.rates import wilson

KINDS = ("right", "refused", "wrong", "traceback", "line", "hang", "crash", "process")


def summed(runs: Sequence[dict[str, Any]], what: str) -> dict[str, Counter[str]]:
    """How often each end has come in all runs, by target or kind of fault."""
    counts = {name: Counter[str]() for run in runs for name in run[what]}
    for run in runs:
        for name, ends in run[what].items():
            counts[name].update(ends)
    return counts


def fuzz(runs: Sequence[dict[str, Any]]) -> str:
    """The commands, and what became of each target's inputs in all of them."""
    stretches: list[list[int]] = []  # seed, first input and number of inputs; parts that follow each other are one
    for seed, first, inputs in sorted((run["seed"], run.get("first", 0), run["inputs"]) for run in runs):
        if stretches and stretches[-1][0] == seed and sum(stretches[-1][1:]) == first:
            stretches[-1][2] += inputs
        else:
            stretches.append([seed, first, inputs])
    commands = [f"python tools/fuzz.py --seed {s} --first {first} --inputs {inputs}" for s, first, inputs in stretches]
    counts = summed(runs, "targets")
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
    ends = summed(runs, "kinds")
    whole = sum(ends.values(), Counter[str]())
    rows = [[f"`{name}`", str(found["same"]), str(found["wrong"])] for name, found in ends.items()]
    rows.append(["**all**", f"**{whole['same']}**", f"**{whole['wrong']}**"])
    return "```\n" + "\n".join(commands) + f"\n```\n\n{table(['fault', 'the same bytes', 'anything else'], rows)}"


def _only(run: dict[str, Any]) -> str:
    return f" --only {','.join(run['kinds'])}" if set(run["kinds"]) < {kind.__name__ for kind in FAULTS} else ""


def mutation(runs: Sequence[dict[str, Any]]) -> str:
    """The commands, the score of each part in each draw, and what survived the last one."""
    draws: dict[int, dict[str, Any]] = {}
    for run in runs:  # a draw may have been made in several commands
        draws.setdefault(run["seed"], {}).update(run["parts"])
    commands, rows = [], []
    for seed, parts in draws.items():
        most = max(part["run"] for part in parts.values())
        only = f" --only {','.join(parts)}" if len(parts) < len(CORE) else ""
        commands.append(f"python tools/mutation.py --sample {most} --seed {seed}{only}")
        run, killed = (sum(part[key] for part in parts.values()) for key in ("run", "killed"))
        low, high = wilson(killed, run)
        by_part = (f"{parts[name]['killed']} of {parts[name]['run']}" if name in parts else "" for name in CORE)
        rows.append(
            [str(seed), *by_part, f"{killed} of {run}", f"{100.0 * killed / run:.1f}", f"{low:.1f} to {high:.1f}"]
        )
    mutants = ", ".join(f"{part['mutants']:,} in {name}" for name, part in parts.items())
    survived = [one for part in parts.values() for one in part["survived"]]
    lived = "".join(f"\n- `{one.removeprefix('merge_cosim/')}`" for one in survived)
    listed = f"\nSurvived draw {seed} (module, line, what it was changed to):\n{lived}\n" if survived else ""
    shown = table(["seed", *CORE, "killed", "%", "95 %"], rows)
    return "```\n" + "\n".join(commands) + f"\n```\n\nMutants: {mutants}.\n\n{shown}\n{listed}"


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the blocks of which the output is given."""
    parser = page_parser(__doc__)
    parser.add_argument("--fuzz", type=Path, nargs="+", help="what the commands have printed")
    parser.add_argument("--again", type=Path, nargs="+", help="the same, of inputs that were faults before")
    parser.add_argument("--corpus", type=Path, help="what the command has printed")
    parser.add_argument("--faults", type=Path, nargs="+", help="what the commands have printed")
    parser.add_argument("--mutation", type=Path, nargs="+", help="what the commands have printed, draw by draw")
    given = parser.parse_args(argv)
    made = {}
    for name, shown in (("fuzz", fuzz), ("again", fuzz), ("faults", faults), ("mutation", mutation)):
        if files := getattr(given, name):
            made[name] = shown([json.loads(file.read_text()) for file in files])
    if given.corpus:
        made["corpus"] = ramps(json.loads(given.corpus.read_text()))
    fill_page("robustness.md", given.docs, {"runs": made.get})


if __name__ == "__main__":
    main()

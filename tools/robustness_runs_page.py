"""Set what the long commands have printed into docs/robustness.md.

python tools/fuzz.py --inputs 100000 --seed 14 > fuzz.json
python tools/faults.py --faults 300 --seed 14 > faults.json
python tools/mutation.py --sample 25 > mutation.json
python tools/robustness_runs_page.py --fuzz fuzz.json --faults faults.json --mutation mutation.json
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from blocks import fill_page, page_parser, table

KINDS = ("right", "refused", "wrong", "traceback", "line", "hang", "crash", "process")


def fuzz(found: dict[str, Any]) -> str:
    """The command, and what became of each target's inputs."""
    first = f" --first {found['first']}" if found.get("first") else ""
    command = f"python tools/fuzz.py --inputs {found['inputs']} --seed {found['seed']}{first} > fuzz.json"
    rows = [[name, *(f"{ends.get(kind, 0):,}" for kind in KINDS)] for name, ends in found["targets"].items()]
    rows.append(["**all**", *(f"**{found.get(kind, 0):,}**" for kind in KINDS)])
    return f"```\n{command}\n```\n\n{table(['target', *KINDS], rows)}"


def faults(found: dict[str, Any]) -> str:
    """The command, and how the sweeps ended, by kind of fault."""
    command = f"python tools/faults.py --faults {found['faults']} --seed {found['seed']} > faults.json"
    rows = [[f"`{name}`", str(ends["same"]), str(ends["wrong"])] for name, ends in found["kinds"].items()]
    rows.append(["**all**", f"**{found['same']}**", f"**{found['wrong']}**"])
    return f"```\n{command}\n```\n\n{table(['fault', 'the same bytes', 'anything else'], rows)}"


def mutation(found: dict[str, Any]) -> str:
    """The command, the score of each part, and what survived."""
    most = max(part["run"] for part in found["parts"].values())
    command = f"python tools/mutation.py --sample {most} --seed {found['seed']} > mutation.json"
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
    parts = {"fuzz": fuzz, "faults": faults, "mutation": mutation}
    for name in parts:
        parser.add_argument(f"--{name}", type=Path, help="what the command has printed")
    given = parser.parse_args(argv)
    files = {name: getattr(given, name) for name in parts}
    made = {name: parts[name](json.loads(file.read_text())) for name, file in files.items() if file}
    fill_page("robustness.md", given.docs, {"runs": made.get})


if __name__ == "__main__":
    main()

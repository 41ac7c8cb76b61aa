"""Options that several commands share."""

import re
from pathlib import Path
from typing import Annotated, Literal

import typer


def _names(values: list[str] | None) -> list[str] | None:
    """The parts of comma lists, in their order."""
    return [name.strip() for value in values for name in value.split(",")] if values else values


def scenarios_like(incomplete: str) -> list[str]:
    """Shipped scenarios that begin so; for completion in a shell."""
    from merge_cosim.scenarios.scenario import scenario_names

    return [name for name in scenario_names() if name.startswith(incomplete)]


def methods_like(incomplete: str) -> list[str]:
    """Methods whose last name in `a,b+c` begins so; for completion in a shell."""
    from merge_cosim.controllers.base import controllers
    from merge_cosim.scenarios.methods import default_methods

    last = re.split("[,+]", incomplete)[-1]
    before = incomplete[: len(incomplete) - len(last)]
    names = controllers.names() if before.endswith("+") else default_methods()
    return [before + name for name in names if name.startswith(last)]


Source = Literal["ngsim", "surrogate"]
Data = Annotated[Path | None, typer.Option(help="Folder with NGSIM files (else $MERGE_COSIM_DATA, else ./data).")]
Scenario = Annotated[str, typer.Argument(help="Shipped scenario or scenario file.", autocompletion=scenarios_like)]
Methods = Annotated[
    list[str] | None,
    typer.Option(
        help="Estimator, or estimator+controller; several as a,b,c or by repetition; all if not given.",
        callback=_names,
        autocompletion=methods_like,
    ),
]
Model = Annotated[
    str | None, typer.Option(help="Model file, folder of model files, or name of a model that comes with the project.")
]
Sets = Annotated[list[str] | None, typer.Option("--set", help="NAME=VALUE, such as acc.headway=1.2 or test.horizon=5.")]
Plugins = Annotated[list[Path] | None, typer.Option(help="Python file with components of your own.")]
Against = Annotated[
    str | None, typer.Option(help="Method to compare the others with on the same cases; pgm if it was run.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
MOST_SEED = 2**31 - 1
"""Largest seed that SUMO takes."""
Seed = Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of SUMO and of every random stream.")]
ForceSource = Annotated[Source | None, typer.Option("--source", help="Force real data or the surrogate.")]
World = Annotated[
    Literal["sumo", "closed-form"],
    typer.Option(help="What moves the cars: SUMO, or s' = s + v dt (many times faster; pairs only)."),
]
UncheckedRamp = Annotated[
    bool, typer.Option("--unchecked-ramp", help="Run on a ramp that does not pass 'ramp check', too.")
]
Host = Annotated[
    Literal["main", "ramp"] | None,
    typer.Option(help="Where the automated car drives, with the other car on the other path; as --set host=..."),
]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; one per core by default.")]
Wide = Annotated[bool, typer.Option("--wide", help="Show more columns than fit 80 characters.")]
Columns = Annotated[
    list[str] | None,
    typer.Option(help="Columns of summary.csv to show, as a,b,c or by repetition.", callback=_names),
]

"""Options that several commands share."""

from pathlib import Path
from typing import Annotated, Literal

import typer

Source = Literal["ngsim", "surrogate"]
Data = Annotated[Path | None, typer.Option(help="Folder with NGSIM files (else $MERGE_COSIM_DATA, else ./data).")]
Model = Annotated[str | None, typer.Option(help="Model file, or name of a model that comes with the project.")]
Sets = Annotated[list[str] | None, typer.Option("--set", help="NAME=VALUE, such as acc.headway=1.2 or test.horizon=5.")]
Plugins = Annotated[list[Path] | None, typer.Option(help="Python file with components of your own.")]
Against = Annotated[
    str | None, typer.Option(help="Method to compare the others with on the same cases; pgm if it was run.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Seed = Annotated[int, typer.Option(help="Seed of SUMO and of every random stream.")]
ForceSource = Annotated[Source | None, typer.Option("--source", help="Force real data or the surrogate.")]
Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; one per core by default.")]

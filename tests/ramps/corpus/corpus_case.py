"""A ramp of the corpus: how it is made, and which path and host lane are right."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

FAR, END = -900.0, 2600.0
"""Where the main roads of the corpus begin and end [m past the gore]."""
GORE = (0.0, 0.0)


@dataclass(frozen=True)
class Case:
    """One ramp.

    Attributes:
        name: What it is.
        make: Writes the file into a folder and returns it.
        main: The right main road: way numbers or edge ids, each once.
        ramp: The right on-ramp before the gore, likewise.
        from_left: How many lanes lie left of the host's after the gore.
        lane: Whether there is an acceleration lane.
        numbers: More arguments for `ramp new`.
        refused: What the line says with which the ramp is refused; empty if it is taken.
    """

    name: str
    make: Callable[[Path], Path]
    main: Sequence[str]
    ramp: Sequence[str]
    from_left: int
    lane: bool = True
    numbers: Mapping[str, object] | None = None
    refused: str = ""

"""How far a sweep is: a bar on standard error, or now and then a line where that is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

LINE_EVERY_S = 10.0
"""Time between two plain lines [s]; a shorter sweep prints none."""

Progress = Callable[[int, int, str], None]
"""Takes the cases done, the cases in all, and what is being run."""


@contextmanager
def sweep_progress(shown: bool = True) -> Iterator[Progress]:
    """Yield what `sweep` is to call after each chunk of cases; it shows nothing unless `shown`."""
    console = Console(stderr=True)
    if not shown:
        yield lambda done, total, what: None
    elif console.is_terminal:
        columns = (TextColumn("{task.description:32}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Bar(*columns, console=console, transient=True, auto_refresh=False) as bar:  # no thread
            task = bar.add_task("preparing", total=None)
            yield lambda done, total, what: bar.update(
                task, completed=done, total=total, description=what, refresh=True
            )
    else:
        yield _Lines()


class _Lines:
    """Prints a line every `LINE_EVERY_S`."""

    def __init__(self) -> None:
        self._last = monotonic()

    def __call__(self, done: int, total: int, what: str) -> None:
        if monotonic() - self._last >= LINE_EVERY_S:
            self._last = monotonic()
            print(f"{done:,} of {total:,} cases, {what}", file=sys.stderr, flush=True)

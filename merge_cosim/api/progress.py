"""How far a sweep is: a bar on standard error, or now and then a line where that is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from merge_cosim.sweeps.forecast import duration

LINE_EVERY_S = 10.0
"""Time between two plain lines [s]; a sweep that takes less prints none."""

SURE_FROM = 0.1
"""Share of the cases after which the time left is told: the first ones also wait for workers to be ready."""

Progress = Callable[[int, int, str], None]
"""Takes the cases done, the cases in all, and what is being run; with none done, what there is to run."""


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

            def show(done: int, total: int, what: str) -> None:
                if not done:
                    bar.console.print(what, highlight=False)
                bar.update(task, completed=done, total=total, description=what if done else "running", refresh=True)

            yield show
    else:
        yield _Lines()


class _Lines:
    """Prints what there is to run, and then a line every `LINE_EVERY_S`."""

    def __init__(self) -> None:
        self._begin = self._last = monotonic()

    def __call__(self, done: int, total: int, what: str) -> None:
        now = monotonic()
        if not done:
            print(what, file=sys.stderr, flush=True)
            self._begin = self._last = now
        elif now - self._last >= LINE_EVERY_S:
            self._last = now
            left = (now - self._begin) * (total - done) / done
            tells = SURE_FROM * total <= done < total
            told = f", about {duration(left)} left" if tells else ""
            print(f"{done:,} of {total:,}{told}: {what}", file=sys.stderr, flush=True)

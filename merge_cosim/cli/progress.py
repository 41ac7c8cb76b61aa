"""A progress bar on standard error, and the message after an interrupt."""

import errno
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from merge_cosim.core.errors import UserError


@contextmanager
def sweep_progress() -> Iterator[Callable[[int, int, str], None]]:
    """Yield a function that takes the cases done, the cases in all, and what is being run."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:32}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    disable = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=disable, auto_refresh=False) as bar:  # no thread
        task = bar.add_task("preparing", total=None)

        def show(done: int, total: int, what: str) -> None:
            bar.update(task, completed=done, total=total, description=what, refresh=True)

        yield show


@contextmanager
def resumable(how: str) -> Iterator[None]:
    """On Ctrl-C (which ends with status 130) and on a full disk say how to go on."""
    import typer

    try:
        yield
    except KeyboardInterrupt:
        typer.echo(f"interrupted: {how}", err=True)
        raise typer.Exit(130) from None
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        raise UserError(f"no space left on the disk; {how}") from None

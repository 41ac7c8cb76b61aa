"""What an interrupt, the signal to end and a full disk do."""

import errno
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from merge_cosim.core.errors import UserError
from merge_cosim.core.signals import interrupted_once


def ended_by_signal() -> None:
    """Let SIGTERM end this process as an error would: workers and programs are ended first; status 143.

    Of interrupts see `interrupted_once`.
    """

    def end_programs() -> None:
        from merge_cosim.core import programs

        programs.end_programs()

    def end(number: int, _: object) -> None:
        end_programs()
        raise SystemExit(128 + number)

    interrupted_once(end_programs)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, end)


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

"""What an interrupt and a full disk say."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from merge_cosim.core.errors import UserError


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

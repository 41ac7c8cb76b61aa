"""Starting SUMO: inside this process by libsumo, in another by TraCI, or to its end without a session."""

from __future__ import annotations

import io
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.core.programs import missing_library, run_program
from merge_cosim.core.units import HOUR
from merge_cosim.sumo.options import SumoOptions
from merge_cosim.sumo.session import Session

LONGEST_RUN = 4 * HOUR
"""Longest time for a SUMO that runs to its end by itself [s]; a recording of the surrogate takes a minute."""

QUIT = "--quit-on-end"
"""Option of sumo-gui: its window closes when the simulation ends."""
_NO_REASON = "Process Error"
"""What libsumo raises where it has printed the reason."""


class LibsumoSession(Session):
    """SUMO inside this process. libsumo holds one simulation per process: opening a second one ends the first."""

    def __init__(self, options: SumoOptions) -> None:
        """Start SUMO.

        Raises:
            UserError: It does not start; the line begins with the file that it is started with. Or it cannot be loaded.
        """
        try:
            import libsumo
        except ImportError as error:
            if line := missing_library(str(error)):
                raise UserError(line) from None
            raise
        errors = (libsumo.TraCIException, libsumo.FatalTraCIError)
        words = ["--remote-port", "0"]  # with another port in the configuration SUMO would wait there
        with _stderr_held_back() as written:
            try:
                libsumo.start(["sumo", *options.arguments(), *words])
            except errors as error:
                # SUMO prints the reason of some mistakes on standard error only.
                reason = one_line(error)
                lines = written().splitlines() if reason == _NO_REASON else []
                reasons = [line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")]
                raise UserError(f"{options.file}: SUMO cannot start: {' '.join(reasons) or reason}") from None
            output = written()
        sys.stderr.write(output)
        super().__init__(libsumo, errors)


class TraciSession(Session):
    """SUMO, or sumo-gui, in a process of its own."""

    def __init__(self, options: SumoOptions, gui: bool = False) -> None:
        """Start SUMO.

        Raises:
            UserError: It does not start; the line begins with the file that it is started with. Or it cannot be loaded.
        """
        traci = own_traci()
        errors = (traci.TraCIException, traci.FatalTraCIError)
        command = [sumolib.checkBinary("sumo-gui" if gui else "sumo"), *options.arguments()]
        if gui:
            command += ["--start", "--window-size", "1200,500"]
        with redirect_stdout(io.StringIO()):  # traci prints its attempts to connect
            try:
                traci.start(command, stdout=sys.stderr)
            except errors as error:
                raise UserError(f"{options.file}: SUMO cannot start: {one_line(error)}") from None
        super().__init__(traci, errors)
        if gui and QUIT not in options.extra:
            self.close = self._close_after_window

    def _close_after_window(self) -> None:
        """End the simulation, whose window stays until it is closed by hand."""
        print("The case is over; close the window of sumo-gui to go on.", file=sys.stderr, flush=True)
        self._api.close()


def open_session(options: SumoOptions, gui: bool = False) -> Session:
    """Start SUMO in this process, or sumo-gui in another."""
    return TraciSession(options, gui=True) if gui else LibsumoSession(options)


def run_sumo(options: SumoOptions) -> None:
    """Run SUMO in a process of its own to the end of its simulation.

    Raises:
        UserError: It fails; the line begins with the file that it is started with.
    """
    command: Sequence[str] = [sumolib.checkBinary("sumo"), *options.arguments()]
    done = run_program(command, LONGEST_RUN, options.file)
    if done.returncode:
        reason = (done.stderr.decode(errors="replace").strip() or "no reason given").splitlines()[0]
        raise UserError(f"{options.file}: SUMO fails on it: {reason}")


def own_traci() -> Any:
    """The module traci, and not libsumo under its name."""
    import traci

    if "libsumo" in str(getattr(traci, "__file__", "")):
        raise UserError("environment: LIBSUMO_AS_TRACI is set, which turns traci into libsumo; unset it")
    return traci


@contextmanager
def connection_kept() -> Iterator[None]:
    """Turn the end of a SUMO in another process, as when its window is closed, into one line."""
    try:
        yield
    except Exception as error:
        import traci

        if not isinstance(error, traci.FatalTraCIError):
            raise
        raise UserError(f"SUMO has ended before the case was over: {error}") from None


@contextmanager
def running(session: Session, file: Path) -> Iterator[Session]:
    """Use a session and close it; an error of SUMO meanwhile becomes one line that begins with `file`.

    Raises:
        UserError: SUMO has ended or refuses something.
    """
    try:
        with connection_kept():
            yield session
    except session.errors as error:
        raise UserError(f"{file}: SUMO stopped: {one_line(error)}") from None
    finally:
        session.close()


def one_line(error: Exception) -> str:
    """SUMO's message of an error, in one line."""
    return " ".join(str(error).split()) or "no reason given"


@contextmanager
def _stderr_held_back() -> Iterator[Callable[[], str]]:
    """Hold back what libraries write to standard error; the function that is given returns it."""
    sys.stderr.flush()
    with tempfile.TemporaryFile() as file:

        def written() -> str:
            file.seek(0)
            return file.read().decode(errors="replace")

        kept = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield written
        finally:
            os.dup2(kept, 2)
            os.close(kept)

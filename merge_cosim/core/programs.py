"""Running other programs (SUMO's): each with a time limit, in a process group of its own, and ended with this one."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.core.signals import held_back

PACKAGES = "libatomic1 libexpat1 libgl1 libx11-6 libxext6 libxrender1"
"""Packages of Debian and Ubuntu with the system libraries that the wheels of SUMO need, also without a window."""

NOT_LOADED = 127
"""Exit status of a program that the loader could not start."""

_WATCHED = 'exec 3<&0; (read -r _ <&3 || kill -s KILL -- -$$) >/dev/null 2>&1 & exec "$@" </dev/null 3<&-'
"""For `sh -c`: become the program, and kill its group when the other end of standard input closes without a line."""

_running: set[subprocess.Popen[bytes]] = set()


def run_program(
    command: Sequence[str], seconds: float, file: Path, cwd: Path | None = None, captured: bool = True
) -> subprocess.CompletedProcess[bytes]:
    """Run a program to its end. An exception here, or the end of this process, ends it and all that it has started.

    A program whose output is not kept, such as an editor with unsaved work, is not ended when this process is killed.

    Args:
        command: The program and its arguments.
        seconds: Time limit [s].
        file: What it works on, for the line about a limit that is passed.
        cwd: The folder to run it in.
        captured: Return what it prints; else its output goes where this process prints.

    Raises:
        UserError: It cannot be started, takes too long, or lacks a system library.
    """
    pipe = subprocess.PIPE if captured else None
    process, ended = None, False
    if shutil.which(command[0]) is None:
        raise UserError(f"{command[0]}: cannot be started (no such program)")
    watched = ["/bin/sh", "-c", _WATCHED, "sh", *command] if captured else command
    there, here = os.pipe()  # the system closes our end if we are killed
    try:
        with held_back(signal.SIGINT, signal.SIGTERM):  # an exception within Popen would leave the program running
            process = subprocess.Popen(
                watched,
                cwd=cwd,
                stdin=there if captured else subprocess.DEVNULL,
                stdout=pipe,
                stderr=pipe,
                start_new_session=True,
            )
            _running.add(process)
        output, errors = process.communicate(timeout=seconds)
        ended = True
    except OSError as error:
        raise UserError(f"{command[0]}: cannot be started ({error.strerror})") from None
    except subprocess.TimeoutExpired:
        name = Path(command[0]).name
        raise UserError(f"{file}: {name} was still at it after {seconds:g} s and was ended; is it damaged?") from None
    finally:
        if process is not None:
            if not ended:
                _end(process)
            _running.discard(process)
        with suppress(BrokenPipeError):
            os.write(here, b"\n")
        for end in (there, here):
            os.close(end)
    if process.returncode == NOT_LOADED and (line := missing_library((errors or b"").decode(errors="replace"))):
        raise UserError(line)
    return subprocess.CompletedProcess(command, process.returncode, output or b"", errors or b"")


def missing_library(message: str) -> str | None:
    """One line that says how to mend it, if a message of Linux's loader is about a system library not found."""
    found = re.search(r"(lib[\w.+-]+): cannot open shared object file", message)
    return found and f"SUMO needs the system library {found[1]}; on Debian and Ubuntu: apt-get install {PACKAGES}"


def end_programs() -> None:
    """End every program that runs, as when this process is ended by a signal."""
    for process in tuple(_running):
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a program and what it has started, which may go on after its own end."""
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()

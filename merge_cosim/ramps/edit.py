"""Open a ramp in netedit, SUMO's graphical editor."""

import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import sumolib

from merge_cosim.errors import UserError
from merge_cosim.ramps.build import config
from merge_cosim.ramps.view import netedit_view


def editor_command(folder: Path) -> list[str]:
    """The command line that opens a ramp's plain XML sources in netedit."""
    return [sumolib.checkBinary("netedit"), "--netccfg-file", str(config(folder).resolve())]


def open_editor(folder: Path, say: Callable[[str], object]) -> None:
    """Open a ramp in netedit, say what to do, and wait until the editor is closed.

    Raises:
        UserError: There is no display to open it on, or netedit fails.
    """
    command = editor_command(folder)
    say(shlex.join(command))
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UserError("ramp edit: no display to open netedit on; set DISPLAY, or edit the plain XML by hand")
    settings, name = config(folder), config(folder).stem
    kept = settings.read_bytes()
    say(f"Save with File > Save Plain XML (Ctrl+L) over {name}.edg.xml; where a road's length changes, change")
    say("its attribute 'length' and ramp.toml, too. Then close the editor and run:")
    say(f"merge-cosim ramp build {shlex.quote(str(folder))}")
    with tempfile.TemporaryDirectory() as scratch:
        command += netedit_view(folder, Path(scratch))
        status = subprocess.run(command, cwd=folder, check=False).returncode  # its dialogues begin in the ramp's folder
    # netedit writes a configuration of the same name, with absolute paths and without our options.
    settings.write_bytes(kept)
    if status:
        raise UserError(f"{settings}: netedit ended with status {status}")

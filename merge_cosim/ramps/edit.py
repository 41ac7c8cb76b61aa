"""Open a ramp in netedit, SUMO's graphical editor, and keep what is saved there."""

import os
import shlex
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.core.programs import run_program
from merge_cosim.ramps.build import HEAD, config, netconvert
from merge_cosim.ramps.definition import read_ramp_file
from merge_cosim.ramps.view import netedit_view

DAY = 86_400.0
"""Longest time for which netedit stays open [s]."""


def editor_command(folder: Path) -> list[str]:
    """The command line that opens a ramp's plain XML sources in netedit."""
    return [sumolib.checkBinary("netedit"), "--netccfg-file", str(config(folder).resolve())]


def open_editor(folder: Path, say: Callable[[str], object]) -> None:
    """Open a ramp in netedit, print what to do, and wait until the editor is closed.

    Raises:
        UserError: There is no display to open it on, or netedit fails.
    """
    command = editor_command(folder)
    say(shlex.join(command))
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UserError("ramp edit: no display to open netedit on; set DISPLAY, or edit the plain XML by hand")
    settings, started = config(folder), time.time_ns()
    kept = settings.read_bytes()
    # netedit's dialogues begin where the last one ended, perhaps among another ramp's files.
    say(f"Save with File > Save Network (Ctrl+S) over {(folder / read_ramp_file(folder).net).resolve()};")
    say("when netedit is closed, the plain XML is written anew from that, without comments.")
    say("Where a road's length changes, change its attribute 'length' and ramp.toml, too. Then close netedit and run:")
    say(f"merge-cosim ramp build {shlex.quote(str(folder))}")
    try:
        with tempfile.TemporaryDirectory() as scratch:
            command += netedit_view(folder, Path(scratch))
            status = run_program(command, DAY, settings, cwd=folder, captured=False).returncode
    finally:
        # netedit writes a configuration of the same name, with absolute paths and without our options.
        if settings.read_bytes() != kept:
            settings.write_bytes(kept)
    if take_over_net(folder, started):
        say("The plain XML was written from the saved net.")
    if status:
        raise UserError(f"{settings}: netedit ended with status {status}")


def take_over_net(folder: Path, since: int) -> bool:
    """Write the plain XML from a net that was saved after it, for Save Network saves only the net.

    Returns whether it had to.

    Args:
        folder: The ramp's folder.
        since: The net is taken over if it was saved after this time [ns since the epoch].

    Raises:
        UserError: netconvert refuses the net.
    """
    net, plain = folder / read_ramp_file(folder).net, _plain(config(folder))
    if not all(file.is_file() for file in (net, *plain)):
        return False
    if net.stat().st_mtime_ns <= max(since, *(file.stat().st_mtime_ns for file in plain)):
        return False
    with tempfile.TemporaryDirectory() as scratch:
        prefix = Path(scratch) / "net"
        # Without avoid-overlap, which is off for nets, the net that is built again would differ.
        options = ("--geometry.avoid-overlap", "true", "--plain-output-prefix", str(prefix))
        netconvert(net, "--sumo-net-file", str(net), *options)
        for made, file in zip(_plain(prefix), plain, strict=True):
            file.write_bytes(HEAD.sub(rb"\1\n\n", made.read_bytes()))
    return True


def _plain(file: Path) -> list[Path]:
    """The plain XML beside a configuration of the same name: nodes, edges, connections."""
    return [file.with_suffix(f".{kind}.xml") for kind in ("nod", "edg", "con")]

"""Build a ramp's net from its plain XML."""

import re
import subprocess
import tempfile
from pathlib import Path

import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.definition import read_ramp_file

HEAD = re.compile(rb"\A(<\?xml[^>]*\?>)\s*<!--.*?-->\s*", re.DOTALL)
"""Head of a file that one of SUMO's programs has written: it names date, version and command."""


def build(folder: Path) -> Path:
    """Run netconvert on a ramp's `.netccfg` and return the net, the same bytes for the same sources.

    Raises:
        UserError: There is not exactly one `.netccfg`, or netconvert refuses the sources.
    """
    target = folder / read_ramp_file(folder).net
    net = built(config(folder))
    try:
        target.write_bytes(net)
    except OSError as error:
        raise UserError(f"{target}: cannot be written ({error.strerror})") from None
    return target


def built(settings: Path) -> bytes:
    """The net that a netconvert configuration makes, without its head.

    Raises:
        UserError: netconvert refuses it.
    """
    with tempfile.TemporaryDirectory() as scratch:
        target = Path(scratch) / "built.net.xml"
        netconvert(settings, "--configuration-file", str(settings), "--output-file", str(target))
        # The head names date, version and command, none of which belongs to the net.
        return HEAD.sub(rb"\1\n\n", target.read_bytes())


def netconvert(file: Path, *options: str) -> None:
    """Run netconvert on a user's file.

    Raises:
        UserError: It fails; the line names the file and netconvert's reason.
    """
    command = [sumolib.checkBinary("netconvert"), *options]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.startswith("Error")] or done.stderr.splitlines()
        raise UserError(f"{file}: netconvert refuses it: {lines[0] if lines else 'no reason given'}")


def config(folder: Path) -> Path:
    """The one netconvert configuration in a folder."""
    found = sorted(folder.glob("*.netccfg"))
    if len(found) != 1:
        raise UserError(f"{folder}: {len(found)} files *.netccfg; a ramp that can be built has exactly one")
    return found[0]

"""Build a ramp's net from its plain XML."""

import re
import tempfile
from pathlib import Path

import sumolib

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import without_comma
from merge_cosim.core.programs import run_program
from merge_cosim.core.xml_file import root_element
from merge_cosim.ramps.definition import read_ramp_file

PLAIN = ("nod", "edg", "con", "tll", "typ")
"""Kinds of plain XML."""

LIMIT = 900.0
"""Longest time for netconvert [s]."""

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
    plain = (each for kind in PLAIN for each in file.parent.glob(f"*.{kind}.xml") if file.suffix == ".netccfg")
    for each in filter(Path.is_file, (file, *plain)):
        root_element(each)  # netconvert would follow the entities of a document type
    without_comma(file)
    command = [sumolib.checkBinary("netconvert"), *options]
    done = run_program(command, LIMIT, file)
    if done.returncode:
        output = done.stderr.decode(errors="replace").splitlines()
        lines = [line for line in output if line.startswith("Error")] or output
        raise UserError(f"{file}: netconvert refuses it: {lines[0] if lines else 'no reason given'}")


def config(folder: Path) -> Path:
    """The one netconvert configuration in a folder."""
    found = sorted(folder.glob("*.netccfg"))
    if len(found) != 1:
        raise UserError(f"{folder}: {len(found)} files *.netccfg; a ramp that can be built has exactly one")
    return found[0]

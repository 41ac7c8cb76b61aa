"""How SUMO's windows show a ramp: the file `view.xml` in its folder colours lanes by what they are for."""

import shutil
from pathlib import Path

from merge_cosim.core.xml_file import read_xml

FILE_NAME = "view.xml"

ROLES = {"main": 0, "host": 1, "auxiliary": 2, "ramp": 3, "exit": 4}
"""Values of a lane's parameter `role`, by which `view.xml` colours it."""

_BY_LANE_PARAMETER = {"sumo-gui": 32, "netedit": 13}
"""Either program's number (SUMO 1.28) for the colours `by param (numerical, lanewise)`."""


def view_options(folder: Path) -> tuple[str, ...]:
    """Options of sumo-gui that show a ramp in its own colours; none if its folder has no view.

    Raises:
        UserError: The view is no XML.
    """
    file = folder / FILE_NAME
    if not file.is_file():
        return ()
    read_xml(file)
    return ("--gui-settings-file", str(file.resolve()))


def copy_view(folder: Path, target: Path) -> bool:
    """Copy a ramp's view, if it has one, to another folder."""
    file = folder / FILE_NAME
    if file.is_file():
        shutil.copyfile(file, target / FILE_NAME)
    return file.is_file()


def netedit_view(folder: Path, scratch: Path) -> tuple[str, ...]:
    """The same as `view_options` for netedit, with a copy of the view in `scratch` that has netedit's numbers."""
    if not view_options(folder):
        return ()
    text = (folder / FILE_NAME).read_bytes()
    ours, theirs = (f'laneEdgeMode="{_BY_LANE_PARAMETER[program]}"'.encode() for program in ("sumo-gui", "netedit"))
    (scratch / FILE_NAME).write_bytes(text.replace(ours, theirs))
    return view_options(scratch)

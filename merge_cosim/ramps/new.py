"""Start a ramp of one's own from a copy of the designed one."""

import re
from pathlib import Path

from lxml import etree

from merge_cosim.errors import UserError
from merge_cosim.files import shipped
from merge_cosim.ramps.build import build
from merge_cosim.ramps.definition import FILE_NAME, read_ramp_file
from merge_cosim.ramps.view import copy_view

PATTERN = "designed"
"""The shipped ramp that new ones are copied from."""


def new_ramp(folder: Path, upstream: float, downstream: float, speed_limit: float) -> Path:
    """Copy the designed ramp into a new folder with other lengths and another speed limit, and build it.

    Args:
        folder: The new folder; its name is the ramp's.
        upstream: Length of the main road and of the on-ramp before the gore [m].
        downstream: Length of the road after the gore [m].
        speed_limit: Speed limit [m/s].

    Raises:
        UserError: The folder exists and is not empty, or its name is no plain word.
    """
    name = folder.name
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise UserError(f"{folder}: '{name}' is no name for a ramp; use letters, digits, '-' and '_'")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder}: exists already; choose another name or folder")
    source = shipped("sumo_nets") / PATTERN
    old = read_ramp_file(source)
    stretch = {"before": upstream / old.lengths["main_in"], "after": downstream / old.lengths["main_out"]}
    folder.mkdir(parents=True, exist_ok=True)
    for path in source.glob(f"{PATTERN}.*"):
        target = folder / path.name.replace(PATTERN, name)
        if path.suffixes[-2:] in ([".nod", ".xml"], [".edg", ".xml"]):
            target.write_bytes(_resized(path, stretch, speed_limit))
        elif path.suffixes[-2:] != [".net", ".xml"]:
            target.write_text(path.read_text(encoding="utf-8").replace(PATTERN, name), encoding="utf-8")
    copy_view(source, folder)
    values = {
        "title": f'"{name}"',
        "net": f'"{name}.net.xml"',
        "speed_limit": f"{speed_limit}",
        "main_in": f"{upstream}",
        "ramp": f"{upstream}",
        "main_out": f"{downstream}",
    }
    text, _ = (source / FILE_NAME).read_text(encoding="utf-8").split("[sources]")
    for key, value in values.items():
        text = re.sub(rf'^{key} = ("[^"]*"|[\d.]+)', f"{key} = {value}", text, flags=re.MULTILINE)
    origin = f'geometry = "Copied from the ramp {PATTERN} with other lengths."\n'
    (folder / FILE_NAME).write_text(f"{text}[sources]\n{origin}", encoding="utf-8")
    build(folder)
    return folder


def _resized(path: Path, stretch: dict[str, float], speed_limit: float) -> bytes:
    """A node or edge file with everything before and after the gore, which lies at (0, 0), scaled by a factor each."""
    tree = etree.parse(path)
    for element in tree.iter("node", "edge"):
        part = "after" if element.get("from") == "gore" or element.get("id") == "main_end" else "before"
        for key, value in element.items():
            text = str(value)
            if key in ("x", "y", "length"):
                element.set(key, f"{float(text) * stretch[part]:.2f}")
            elif key == "speed":
                element.set(key, f"{speed_limit:.2f}")
            elif key == "shape" and element.tag == "edge":
                points = ([float(number) * stretch[part] for number in point.split(",")] for point in text.split())
                element.set(key, " ".join(f"{x:.2f},{y:.2f}" for x, y in points))
    return etree.tostring(tree, xml_declaration=True, encoding="UTF-8")

"""A new ramp's folder: its files are written, and the net is built at once."""

import json
import re
from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.ramps.build import build
from merge_cosim.ramps.definition import FILE_NAME, RampFile
from merge_cosim.ramps.view import copy_view

PATTERN = "designed"
"""The shipped ramp whose netconvert configuration and view new ones take over."""
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


def require_new(folder: Path) -> None:
    """Refuse a folder that cannot become a new ramp's.

    Raises:
        UserError: The folder exists and is not empty, or its name is no plain word.
    """
    if not re.fullmatch(r"[A-Za-z0-9_-]+", folder.name):
        raise UserError(f"{folder}: '{folder.name}' is no name for a ramp; use letters, digits, '-' and '_'")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder}: exists already; choose another name or folder")


def write_ramp(folder: Path, nodes: str, edges: str, connections: str, definition: RampFile) -> Path:
    """Write a ramp's plain XML, configuration, view and definition into a new folder, and build the net.

    Args:
        folder: Where to; its name is the ramp's.
        nodes: Content of the `.nod.xml`.
        edges: Content of the `.edg.xml`.
        connections: Content of the `.con.xml`.
        definition: Content of `ramp.toml`.

    Raises:
        UserError: `require_new` refuses the folder, or netconvert the sources.
    """
    require_new(folder)
    name, pattern = folder.name, shipped("sumo_nets") / PATTERN
    folder.mkdir(parents=True, exist_ok=True)
    settings = (pattern / f"{PATTERN}.netccfg").read_text(encoding="utf-8")
    files = {
        f"{name}.nod.xml": nodes,
        f"{name}.edg.xml": edges,
        f"{name}.con.xml": connections,
        f"{name}.netccfg": settings.replace(PATTERN, name),
        FILE_NAME: definition_text(definition),
    }
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")
    copy_view(pattern, folder)
    build(folder)
    return folder


def document(root: str, comment: str, rows: list[str]) -> str:
    """A plain XML file with one comment at its head."""
    lines = [opening(root), f"    <!-- {comment} -->", *(f"    {row}" for row in rows), f"</{root}>"]
    return HEAD + "\n".join(lines) + "\n"


def opening(root: str) -> str:
    """First tag of a plain XML file; it names SUMO's schema, so that netconvert and editors can validate the file."""
    schema = f"http://sumo.dlr.de/xsd/{root}_file.xsd"
    return f'<{root} xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="{schema}">'


def definition_text(file: RampFile) -> str:
    """A definition as the text of `ramp.toml`."""
    # A JSON string, number or list of them is TOML, too.
    rows = [
        f"title = {_toml(file.title)}",
        f"net = {_toml(file.net)}",
        *(["described = true   # a net of its own: it is neither built nor changed"] if file.described else []),
        "",
        f"main = {_toml(file.main)}",
        f"host_lane = {_toml(file.host_lane)}   # SUMO counts from the right",
        f"ramp = {_toml(file.ramp)}",
        f"merging_lane = {_toml(file.merging_lane)}",
        f"gore = {_toml(file.gore)}   # x = 0 at the start of this edge",
        f"merging_point = {_toml(file.merging_point)}   # m past the gore",
        f"speed_limit = {_toml(file.speed_limit)}   # m/s",
    ]
    extensions = file.extensions.model_dump(exclude_none=True)
    tables = (("lengths", "   # m", file.lengths), ("extensions", "   # m past the gore", extensions))
    for title, comment, table in (*tables, ("sources", "", file.sources)):
        if table:
            rows += ["", f"[{title}]{comment}", *(f"{_key(key)} = {_toml(value)}" for key, value in table.items())]
    return "\n".join(rows) + "\n"


def _toml(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def _key(name: str) -> str:
    """A TOML key; edge ids of imported nets hold characters that need quotes."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _toml(name)

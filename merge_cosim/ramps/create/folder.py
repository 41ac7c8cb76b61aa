"""A new ramp's folder: its files are written, and the net is built at once."""

import json
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped, without_comma
from merge_cosim.ramps.build import build
from merge_cosim.ramps.check import check
from merge_cosim.ramps.definition import FILE_NAME, RampFile
from merge_cosim.ramps.picture import draw
from merge_cosim.ramps.view import copy_view

PATTERN = "designed"
"""The shipped ramp whose netconvert configuration and view new ones take over."""
NAME = re.compile(r"[A-Za-z0-9_-]+")
"""What a ramp may be called."""
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


def require_new(folder: Path) -> None:
    """Refuse a folder that cannot become a new ramp's.

    Raises:
        UserError: The folder exists and is not empty, its name is no plain word, or a comma is in its path.
    """
    if not NAME.fullmatch(folder.name):
        raise UserError(f"{folder}: '{folder.name}' is no name for a ramp; use letters, digits, '-' and '_'")
    without_comma(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder}: exists already; choose another name or folder")


def write_ramp(
    folder: Path,
    nodes: str,
    edges: str,
    connections: str,
    definition: RampFile,
    reasons: Mapping[str, str] | None = None,
    left_hand: bool = False,
) -> Path:
    """Write a ramp's plain XML, configuration, view, definition and picture into a new folder, and build the net.

    Args:
        folder: Where to; its name is the ramp's.
        nodes: Content of the `.nod.xml`.
        edges: Content of the `.edg.xml`.
        connections: Content of the `.con.xml`.
        definition: Content of `ramp.toml`.
        reasons: Comments in it, by key.
        left_hand: Traffic keeps left.

    Raises:
        UserError: `require_new` refuses the folder, netconvert the sources, or `ramp check` the ramp; nothing is left.
    """
    require_new(folder)
    name, pattern = folder.name, shipped("sumo_nets") / PATTERN
    settings = (pattern / f"{PATTERN}.netccfg").read_text(encoding="utf-8")
    if left_hand:
        settings = settings.replace("<processing>", '<processing>\n        <lefthand value="true"/>')
    files = {
        f"{name}.nod.xml": nodes,
        f"{name}.edg.xml": edges,
        f"{name}.con.xml": connections,
        f"{name}.netccfg": settings.replace(PATTERN, name),
        FILE_NAME: definition_text(definition, reasons),
    }
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch) / name
        made.mkdir()
        for file, text in files.items():
            (made / file).write_text(text, encoding="utf-8")
        copy_view(pattern, made)
        try:
            build(made)
            require_checked(made, folder, just_built=True)
        except UserError as error:
            raise UserError(str(error).replace(str(made), str(folder))) from None
        draw(made)
        try:
            shutil.copytree(made, folder, dirs_exist_ok=True)
        except (shutil.Error, OSError) as error:
            raise UserError(f"{folder}: cannot be written ({error})") from None
    return folder


def require_checked(folder: Path, named: Path, just_built: bool = False) -> None:
    """Refuse a ramp that `check` finds a problem of; `named` is the file or folder that the error line names.

    Raises:
        UserError: There is a problem; the line holds all of them.
    """
    problems = [line.replace(f"{folder / FILE_NAME}: ", "") for line in check(folder, just_built)]
    if problems:
        raise UserError(f"{named}: no ramp is written, since it would not pass ramp check: {'; '.join(problems)}")


def document(root: str, comment: str, rows: list[str]) -> str:
    """A plain XML file with one comment at its head."""
    lines = [opening(root), f"    <!-- {comment} -->", *(f"    {row}" for row in rows), f"</{root}>"]
    return HEAD + "\n".join(lines) + "\n"


def opening(root: str) -> str:
    """First tag of a plain XML file; it names SUMO's schema, so that netconvert and editors can validate the file."""
    schema = f"http://sumo.dlr.de/xsd/{root}_file.xsd"
    return f'<{root} xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="{schema}">'


def definition_text(file: RampFile, reasons: Mapping[str, str] | None = None) -> str:
    """A definition as the text of `ramp.toml`; above a key stands why it is what it is, as a comment."""
    why = {key: [f"# {text}"] for key, text in (reasons or {}).items()}
    # A JSON string, number or list of them is TOML, too.
    rows = [
        f"title = {_toml(file.title)}",
        f"net = {_toml(file.net)}",
        *(["described = true   # a net of its own: it is neither built nor changed"] if file.described else []),
        "",
        *why.get("main", []),
        f"main = {_toml(file.main)}",
        *why.get("host_lane", []),
        f"host_lane = {_toml(file.host_lane)}   # SUMO counts from the right",
        *why.get("ramp", []),
        f"ramp = {_toml(file.ramp)}",
        f"merging_lane = {_toml(file.merging_lane)}",
        f"gore = {_toml(file.gore)}   # x = 0 at the start of this edge",
        *why.get("merging_point", []),
        f"merging_point = {_toml(file.merging_point)}   # m past the gore",
        *why.get("speed_limit", []),
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

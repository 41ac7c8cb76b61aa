"""`merge-cosim ramp`: list, check, build, edit and start ramps."""

from pathlib import Path
from typing import Annotated

import typer

from merge_cosim.cli.options import Json
from merge_cosim.cli.show import answer, print_json

app = typer.Typer(help="List, check, build and edit ramps.", no_args_is_help=True)

Which = Annotated[str, typer.Argument(metavar="NAME|DIR", help="A shipped ramp's name or a ramp's folder.")]


@app.command("list")
def list_(as_json: Json = False) -> None:
    """Show the shipped ramps."""
    from rich.console import Console
    from rich.table import Table

    from merge_cosim.ramps.ramp import Ramp, ramp_names

    ramps = [Ramp.load(name) for name in ramp_names()]
    if as_json:
        print_json([ramp.summary() for ramp in ramps])
        return
    table = Table("ramp", "title", caption="in metres past the gore; limit in m/s")
    for column in ("merge at", "extra lane to", "from", "to", "limit"):
        table.add_column(column, justify="right")
    for ramp in ramps:
        lane = f"{ramp.auxiliary_end:.0f}" if ramp.changes_lane else "none"
        numbers = (-ramp.upstream, ramp.downstream, ramp.speed_limit)
        table.add_row(
            ramp.name, ramp.title, f"{ramp.merging_point:.0f}", lane, *(f"{number:.0f}" for number in numbers)
        )
    Console().print(table)


@app.command("check")
def check_(which: Which, as_json: Json = False) -> None:
    """Say what is wrong with a ramp; exit status 1 if anything is."""
    from merge_cosim.ramps.check import check, notes
    from merge_cosim.ramps.ramp import find_ramp

    folder = find_ramp(which)
    problems, remarks = check(folder), notes(folder)
    lines = [*(problems or [f"{folder}: no problem found"]), *remarks]
    answer({"folder": str(folder), "problems": problems, "notes": remarks}, "\n".join(lines), as_json)
    if problems:
        raise typer.Exit(1)


@app.command("build")
def build_(which: Which, as_json: Json = False) -> None:
    """Build a ramp's net from its plain XML sources with netconvert."""
    from merge_cosim.ramps.build import build
    from merge_cosim.ramps.check import check
    from merge_cosim.ramps.ramp import find_ramp

    folder = find_ramp(which)
    net = build(folder)
    problems = check(folder)
    answer({"net": str(net), "problems": problems}, "\n".join([f"wrote {net}", *problems]), as_json)
    if problems:
        raise typer.Exit(1)


@app.command("edit")
def edit(which: Which) -> None:
    """Open a ramp in netedit, SUMO's editor, until it is closed."""
    from merge_cosim.ramps.edit import open_editor
    from merge_cosim.ramps.ramp import find_ramp

    open_editor(find_ramp(which), print)


@app.command("new")
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="The new ramp's name: letters, digits, '-' and '_'.")],
    out: Annotated[Path, typer.Option("--out", help="Folder in which the ramp's folder is made.")] = Path("ramps"),
    from_net: Annotated[Path | None, typer.Option(help="A SUMO net with an on-ramp (.net.xml, .net.xml.gz).")] = None,
    from_osm: Annotated[
        Path | None, typer.Option(help="An extract of OpenStreetMap with an on-ramp (.osm, .osm.gz).")
    ] = None,
    link: Annotated[
        str | None, typer.Option(metavar="EDGE", help="An edge of the on-ramp, where the file has several.")
    ] = None,
    lanes: Annotated[int | None, typer.Option(min=1, max=20, help="Main lanes (1).")] = None,
    ramp_lanes: Annotated[int | None, typer.Option(min=1, max=20, help="Lanes of the on-ramp (1).")] = None,
    acceleration_lane: Annotated[
        float | None, typer.Option(min=0.0, max=1e5, help="Its length [m] (0: on-ramp and host's lane go on as one).")
    ] = None,
    upstream: Annotated[
        float | None, typer.Option(min=1.0, max=1e5, help="Road and on-ramp before the gore [m] (500).")
    ] = None,
    downstream: Annotated[float | None, typer.Option(min=1.0, max=1e5, help="Road after the gore [m] (1500).")] = None,
    speed_limit: Annotated[
        float | None, typer.Option(min=1.0, max=100.0, help="Speed limit [m/s] (29, or the file's).")
    ] = None,
    lane_width: Annotated[float | None, typer.Option(min=2.0, max=10.0, help="Width of every lane [m] (3.6).")] = None,
    left_hand: Annotated[
        bool | None,
        typer.Option(
            "--left-hand/--right-hand", help="Side of traffic in an extract (the one on which most links lie)."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Start a ramp of your own: from numbers, a SUMO net or a map.

    A map is an extract of OpenStreetMap.
    """
    from merge_cosim.core.errors import UserError
    from merge_cosim.ramps.create.folder import NAME
    from merge_cosim.ramps.create.start import start_ramp

    numbers = {
        "lanes": lanes,
        "ramp_lanes": ramp_lanes,
        "acceleration_lane": acceleration_lane,
        "upstream": upstream,
        "downstream": downstream,
        "speed_limit": speed_limit,
        "lane_width": lane_width,
        "left_hand": left_hand,
    }
    given = {key: value for key, value in numbers.items() if value is not None}
    if not NAME.fullmatch(name):
        raise UserError(f"ramp new: '{name}' is no name for a ramp; use letters, digits, '-' and '_'")
    folder, found = start_ramp(out / name, given, from_net, from_osm, link)
    edit_it = f"Change it with: merge-cosim ramp edit {folder}"
    _print_found(folder, f"wrote {folder}", found, as_json, edit_it)


@app.command("describe")
def describe(
    net: Annotated[Path, typer.Argument(metavar="FILE.net.xml", help="A SUMO net with an on-ramp (or .net.xml.gz).")],
    link: Annotated[
        str | None, typer.Option(metavar="EDGE", help="An edge of the on-ramp, where the net has several.")
    ] = None,
    speed_limit: Annotated[
        float | None, typer.Option(min=1.0, max=100.0, help="Speed limit [m/s] (the net's).")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a ramp.toml beside a net of your own.

    Then its configurations run; the net is left as it is.
    """
    from merge_cosim.ramps.create.describe import describe_ramp
    from merge_cosim.ramps.create.start import found
    from merge_cosim.ramps.picture import PICTURE

    folder = describe_ramp(net, link, speed_limit)
    _print_found(folder, f"wrote {folder / 'ramp.toml'} and {folder / PICTURE}", found(folder), as_json)


def _print_found(folder: Path, wrote: str, found: list[str], as_json: bool, *more: str) -> None:
    """Print what a new `ramp.toml` rests on, and what is to be said of the ramp."""
    from merge_cosim.ramps.check import check, notes

    problems, remarks = check(folder), notes(folder)
    document = {"folder": str(folder), "found": found, "problems": problems, "notes": remarks}
    answer(document, "\n".join([wrote, *found, *problems, *remarks, *more]), as_json)

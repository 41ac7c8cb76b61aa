"""`merge-cosim methods`, `scenarios`, `models`, `sensors`, `worlds` and `cache`: lists."""

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Annotated, Any

import typer

from merge_cosim.cli.options import Json, Plugins
from merge_cosim.cli.show import answer, print_json, show_table

app = typer.Typer()

WIDTH = 80
"""Columns of a description."""


@app.command()
def methods(
    name: Annotated[
        str | None, typer.Argument(help="Component or method to describe, such as acc, pgm+lqr or designed.")
    ] = None,
    plugin: Plugins = None,
    json: Json = False,
) -> None:
    """List what methods are made of, or describe a part or a method."""
    from merge_cosim.scenarios.catalogue import component, components

    if name is not None:
        found = component(name, plugin or ())
        answer(found, "\n\n".join(map(_description, found)), json)
        return
    rows = components(plugin or ())
    shown = [{k: v for k, v in row.items() if k != "parameters"} for row in rows]
    _list(rows, shown, json, "merge-cosim methods NAME describes one, with its parameters.")


@app.command()
def sensors(json: Json = False) -> None:
    """List how a host can see the merging car."""
    from merge_cosim.scenarios.catalogue import components

    rows = [row for row in components() if row["role"] == "sensor"]
    shown = [{"sensor": row["name"], "about": row["about"]} for row in rows]
    _list(rows, shown, json, "merge-cosim methods NAME describes one; --set sensing.model=NAME uses it.")


@app.command()
def scenarios(
    name: Annotated[str | None, typer.Argument(help="Scenario to describe, or its file.")] = None, json: Json = False
) -> None:
    """List the shipped scenarios, or describe one."""
    from merge_cosim.scenarios.scenario import load_scenario, scenario_names

    rows = [load_scenario(one) for one in ([name] if name else scenario_names())]
    about = {one.name: " ".join(one.about.split()) for one in rows}
    listed = [{"scenario": one.name, "title": one.title, "ramp": one.ramp, "about": about[one.name]} for one in rows]
    if name:
        text = "\n".join(wrap(about[rows[0].name], WIDTH, break_on_hyphens=False))
        answer(listed, f"{rows[0].name}: {rows[0].title}, on the ramp {rows[0].ramp}\n\n{text}", json)
    else:
        shown = [{key: row[key] for key in ("scenario", "ramp", "title")} for row in listed]
        _list(listed, shown, json, "merge-cosim scenarios NAME describes one.")


@app.command()
def models(json: Json = False) -> None:
    """List the learned models that come with the project (--model)."""
    from merge_cosim.api.listing import list_models

    rows = list_models().to_dict("records")
    shown = [{str(key).replace("train_", ""): value for key, value in row.items()} for row in rows]
    about = "Trained on so many pairs and merging cars. A sweep takes its source's model,\n"
    _list(rows, shown, json, about + "or us101-ngsim-all where no real pair is tested. --model takes another.")


@app.command()
def worlds(json: Json = False) -> None:
    """List what can move the cars (--world)."""
    from merge_cosim.simulation.worlds.base import KINDS

    rows = [{"world": kind, "moved by": by, "takes": takes} for kind, (by, takes) in KINDS.items()]
    _list(rows, rows, json)


@app.command()
def cache(clear: Annotated[bool, typer.Option("--clear", help="Delete it.")] = False, json: Json = False) -> None:
    """Show what is kept of generated data, and where."""
    import shutil

    from merge_cosim.core.files import cache_folder

    folder = cache_folder()
    rows = []
    for part in sorted(path for path in folder.iterdir() if path.is_dir()):
        files = [file for file in part.rglob("*") if file.is_file()]
        rows.append(
            {"part": part.name, "files": len(files), "mib": round(sum(f.stat().st_size for f in files) / 2**20, 2)}
        )
        if clear:
            shutil.rmtree(part)
    if json:
        print_json({"folder": str(folder), "cleared": clear, "parts": rows})
    else:
        show_table(rows, f"{folder}{' (cleared)' if clear else ''}")


def _list(rows: Any, shown: Sequence[Mapping[str, Any]], json: bool, *more: str) -> None:
    """Print rows as JSON, or what is shown of them as a table and what there is more to say."""
    if json:
        print_json(rows)
        return
    show_table(shown, "")
    for text in more:
        typer.echo(text)


def _description(part: dict[str, Any]) -> str:
    """A component and its parameters, in lines that fit a terminal of 80 columns."""
    rows = [
        [row["name"], "-" if row["default"] is None else str(row["default"]), row["unit"], row["bounds"]]
        for row in part["parameters"]
    ]
    lines = [f"{part['role']} {part['name']}", ""]
    lines += ["\n".join(wrap(text, WIDTH, break_on_hyphens=False)) + "\n" for text in part["about"].split("\n\n")]
    if controller := part.get("controller"):
        lines.append(
            f"It drives with the controller {controller}, unless another is named: {part['name']}+CONTROLLER.\n"
        )
    if not rows:
        return "\n".join([*lines, "No parameters."])
    head = ["parameter", "default", "unit", "bounds"]
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    for row, meaning in zip((head, *rows), ["", *(row["meaning"] for row in part["parameters"])], strict=True):
        lines.append("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())
        lines += wrap(meaning, WIDTH, initial_indent="    ", subsequent_indent="    ", break_on_hyphens=False)
    owner = {"merging car": "merging", "sensor": "sensing"}.get(part["role"], part["name"])
    return "\n".join([*lines, "", f"Set one with --set {owner}.PARAMETER=VALUE."])

"""`merge-cosim methods`, `scenarios` and `cache`: what there is."""

from typing import Annotated

import typer

from merge_cosim.cli.options import Json, Plugins
from merge_cosim.cli.show import print_json, show_table

app = typer.Typer()


@app.command()
def methods(plugin: Plugins = None, json: Json = False) -> None:
    """List estimators, controllers and merging cars with their parameters."""
    from merge_cosim.scenarios.catalogue import components

    rows = components(plugin or ())
    if json:
        print_json(rows)
    else:
        show_table(
            [{k: v for k, v in row.items() if k != "parameters"} | {"parameters": _listed(row)} for row in rows], ""
        )


@app.command()
def scenarios(json: Json = False) -> None:
    """List the shipped scenarios."""
    from merge_cosim.scenarios.scenario import load_scenario, scenario_names

    rows = [load_scenario(name) for name in scenario_names()]
    listed = [{"scenario": one.name, "title": one.title, "ramp": one.ramp, "about": one.about.strip()} for one in rows]
    if json:
        print_json(listed)
    else:
        show_table(listed, "")


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


def _listed(row: dict[str, object]) -> str:
    values = row["parameters"]
    return ", ".join(f"{key}={value}" for key, value in values.items()) if isinstance(values, dict) else ""

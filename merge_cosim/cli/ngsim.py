"""`merge-cosim ngsim`: NGSIM trajectories in, canonical tables out."""

from pathlib import Path
from typing import Annotated

import typer

from merge_cosim.cli.options import Json
from merge_cosim.cli.show import answer, print_json

app = typer.Typer(help="Import, fetch, look at and imitate NGSIM trajectories.", no_args_is_help=True)

MOST_NAMES = 8
"""Pairs that are named at most."""

A_SITE = "A site: the name of a shipped ramp, or the path of a folder with site.toml"

Files = Annotated[list[Path], typer.Argument(metavar="FILE", help="Trajectory files: text, CSV or Parquet.")]
OptionalSite = Annotated[
    str | None,
    typer.Option("--site", help=f"{A_SITE}. Only it is kept; it is also the site of a file that names none."),
]
Out = Annotated[Path, typer.Option("--out", help="Folder to write to.")]


@app.command("import")
def import_(files: Files, out: Out, site: OptionalSite = None, as_json: Json = False) -> None:
    """Write trajectory files as canonical Parquet, one per site."""
    from dataclasses import asdict

    from rich.console import Console
    from rich.table import Table

    from merge_cosim.ngsim.convert import convert
    from merge_cosim.ngsim.sites import site as find_site

    done = convert(files, out, find_site(site) if site else None)
    if as_json:
        print_json(asdict(done))
        return
    table = Table("site", "recording")
    for name in ("rows", "cars"):
        table.add_column(name, justify="right")
    for row in done.recordings:
        table.add_row(row.site, row.recording, f"{row.rows:,}", f"{row.cars:,}")
    console = Console()
    console.print(table)
    repeats = f"{done.repeats.dropped:,} repeated rows dropped"
    if done.repeats.conflicting:
        repeats += f" ({done.repeats.conflicting:,} of them at another position: the first was kept)"
    console.print(f"{done.rows:,} rows read, {done.kept:,} kept, {repeats}")
    for name, rows in done.elsewhere.items():
        console.print(f"{rows:,} rows passed over: {name}")
    for path in done.written.values():
        console.print(f"wrote {path}", soft_wrap=True)


@app.command("download")
def download_(
    out: Out,
    url: Annotated[str | None, typer.Option("--url", help="Another address than the portal's.")] = None,
    as_json: Json = False,
) -> None:
    """Fetch all NGSIM trajectories (about 1.4 GB).

    They come from the US Department of Transportation.
    """
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn, TransferSpeedColumn

    from merge_cosim.ngsim.download import PORTAL, download

    console = Console(stderr=True)
    columns = (BarColumn(), DownloadColumn(), TransferSpeedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("download", total=None)
        path = download(out, url or PORTAL, lambda done, total: bar.update(task, completed=done, total=total))
    answer({"file": str(path), "bytes": path.stat().st_size}, f"wrote {path}", as_json)


@app.command("summary")
def summary(
    data: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with trajectory files, or one such file.")],
    site: Annotated[str | None, typer.Option("--site", help=f"{A_SITE}; all shipped ones if not given.")] = None,
    as_json: Json = False,
) -> None:
    """Show the encounters in a data folder, and what was rejected.

    Beside them stand the figures of the papers' Table I.
    """
    from math import nan

    from rich.console import Console
    from rich.table import Column, Table

    from merge_cosim.ngsim.pairing.summary import summarise_folder
    from merge_cosim.ngsim.sites import site as find_site

    summaries = summarise_folder(data, [find_site(site)] if site else ())
    if as_json:
        print_json([each.as_dict() for each in summaries])
        return
    table = Table("site", *(Column(name, justify="right") for name in ("pairs", "L_merge", "speed", "yielding")))
    for each in summaries:
        figures = (f"{each.merge_distance_m:.1f} m", f"{each.speed_m_s:.1f} m/s", f"{100 * each.yielding:.0f} %")
        table.add_row(each.site, str(each.pairs), *figures)
        if paper := each.published:
            table.add_row("  published", str(paper.pairs), f"{paper.merge_distance_m} m", f"{paper.speed_m_s} m/s", "")
    console = Console()
    console.print(table)
    for each in summaries:
        shortest, median, longest = each.window_s or (nan, nan, nan)
        lines = {
            "merging cars": f"{each.cars} in pairs, of {each.merging_cars}",
            "windows": f"{shortest:.1f} to {longest:.1f} s, median {median:.1f} s",
            "logs": f"{each.complete} scored to the end, {each.cut} cut by a lane change, {each.extended} extended",
            "flagged": f"{each.smoothed_source} smoothed at the source, {each.length_missing} without a length, "
            f"{each.host_past_start} with the host past the merging point at the start",
            "rejected": ", ".join(f"{count} {why}" for why, count in each.rejected.items()) or "none",
            "logged host fails": _few(each.logged_host_failures) or "in no pair",
        }
        console.print(f"{each.site} ({each.source})")
        for name, text in lines.items():
            console.print(f"  {name}: {text}", soft_wrap=True)


def _few(names: tuple[str, ...]) -> str:
    """Names in a line, not too many."""
    more = f" and {len(names) - MOST_NAMES} more (all of them with --json)" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


@app.command("surrogate")
def surrogate(
    out: Out,
    site: Annotated[str | None, typer.Option("--site", help="Only the site of this shipped ramp.")] = None,
    as_json: Json = False,
) -> None:
    """Write synthetic trajectories, made by SUMO, in NGSIM's format."""
    import pyarrow.parquet as pq

    from merge_cosim.ngsim.sites import site as find_site
    from merge_cosim.ngsim.surrogate.recipe import RECIPES
    from merge_cosim.ngsim.surrogate.surrogate import export

    files = {each.name: export(each, out) for each in map(find_site, [site] if site else RECIPES)}
    written = [
        {"site": name, "file": str(path), "rows": pq.read_metadata(path).num_rows, "source": "surrogate"}
        for name, path in files.items()
    ]
    if as_json:
        print_json(written)
        return
    for each in written:
        print(f"wrote {each['file']}: {each['rows']:,} synthetic rows")

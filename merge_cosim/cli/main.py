"""The command `merge-cosim`: options and printing, no logic. Heavy imports wait until a command needs them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import typer

from merge_cosim import __version__
from merge_cosim.cli import lists, ngsim, ramp, results
from merge_cosim.cli.interrupts import ended_by_signal
from merge_cosim.cli.options import (
    MOST_SEED,
    Against,
    Columns,
    Data,
    ForceSource,
    Host,
    Jobs,
    Json,
    Methods,
    Model,
    Plugins,
    Scenario,
    Seed,
    Sets,
    UncheckedRamp,
    Wide,
    World,
    methods_like,
    scenarios_like,
)
from merge_cosim.cli.show import (
    answer,
    die,
    print_json,
    show_results,
    show_story,
    show_table,
    show_verification,
    verification,
)
from merge_cosim.core.errors import UserError

ABOUT = """SUMO co-simulation of freeway on-ramp merging between an automated host and a human driver.

To begin: merge-cosim sweep designed-2 --method acc,pgm --out out/first, then merge-cosim report out/first.
"""

app = typer.Typer(
    help=ABOUT,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(results.app)
app.add_typer(lists.app)
app.add_typer(ngsim.app, name="ngsim")
app.add_typer(ramp.app, name="ramp")

USAGE_ERROR = cast("type[typer.BadParameter]", typer.BadParameter.__base__)
"""typer's UsageError; typer gives it no public name."""
EMPTY = re.compile("--[a-z-]+=")
"""An option with an empty value, which for a path would be the current folder."""

Start = Literal["spawn", "forkserver", "fork"]


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"merge-cosim {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version and exit.", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Options of the command itself."""


@app.command()
def sweep(
    scenarios: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENARIO...",
            help="Shipped scenarios, families (shifted), or files.",
            autocompletion=scenarios_like,
        ),
    ],
    method: Methods = None,
    model: Model = None,
    set_: Sets = None,
    vary: Annotated[list[str] | None, typer.Option(help="NAME=A:B:STEP or NAME=X,Y,Z; one at a time.")] = None,
    data: Data = None,
    source: ForceSource = None,
    seed: Seed = 0,
    world: World = "sumo",
    host: Host = None,
    unchecked_ramp: UncheckedRamp = False,
    plugin: Plugins = None,
    against: Against = None,
    out: Annotated[Path, typer.Option(help="Result folder.")] = Path("out"),
    jobs: Jobs = None,
    start: Annotated[Start, typer.Option(help="How processes are started.")] = "spawn",
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to run on, or 'local'.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Finish an interrupted sweep.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a sweep that is in the folder.")] = False,
    verify: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Afterwards run this share of the rows again in SUMO.")
    ] = None,
    add: Annotated[bool, typer.Option("--add", help="Add methods, scenarios or cases to the sweep there.")] = False,
    traces: Annotated[
        str | None,
        typer.Option(metavar="all|failed|telling|N", help="Cases to record for the viewer; by default a few."),
    ] = None,
    wide: Wide = False,
    columns: Columns = None,
    json: Json = False,
) -> None:
    """Run scenarios under methods and store one row per case."""
    from merge_cosim.api.sweep import sweep as run_sweep
    from merge_cosim.cli.interrupts import resumable
    from merge_cosim.results.store import ResultFolder
    from merge_cosim.scenarios.settings import parse_setting, parse_variation

    if resume + overwrite + add > 1:
        raise UserError("--resume, --overwrite, --add: choose one")
    with resumable(f"what was finished is kept in {out}; go on with {'--add' if add else '--resume'}"):
        results = run_sweep(
            scenarios,
            method,
            model=model,
            settings=dict(map(parse_setting, set_ or ())) | ({"host": host} if host else {}),
            vary=_joined(map(parse_variation, vary or ())),
            data=data,
            source=source,
            seed=seed,
            against=against,
            plugins=plugin or (),
            jobs=jobs,
            start=start,
            dask=dask,
            world=world,
            unchecked_ramp=unchecked_ramp,
            out=out,
            resume=resume,
            overwrite=overwrite,
            add=add,
            traces=cast(Any, traces),
        )
        again = (
            None if verify is None else results.verify(verify, data=data, model=model, plugins=plugin or (), jobs=jobs)
        )
    if json:
        document = {"summary": ResultFolder(out).summary(), "manifest": results.manifest}
        print_json(document | ({"verification": verification(again)} if again else {}))
    else:
        show_results(out, wide, columns)
    for line in results.notes():
        typer.echo(line, err=True)
    if again:
        if not json:
            show_verification(again, only_beyond=True)
        if again.beyond:
            raise typer.Exit(1)


def _joined(varied: Iterable[tuple[str, list[Any]]]) -> dict[str, list[Any]]:
    """The values by name, where a name may have been given several times."""
    values: dict[str, list[Any]] = {}
    for name, some in varied:
        values[name] = values.get(name, []) + some
    return values


@app.command()
def run(
    scenario: Scenario,
    case: Annotated[str, typer.Option(help="Case, as in the column 'case' of results.parquet.")],
    method: Annotated[str, typer.Option(help="Estimator, or estimator+controller.", autocompletion=methods_like)],
    model: Model = None,
    set_: Sets = None,
    data: Data = None,
    source: ForceSource = None,
    seed: Seed = 0,
    world: World = "sumo",
    host: Host = None,
    unchecked_ramp: UncheckedRamp = False,
    plugin: Plugins = None,
    gui: Annotated[bool, typer.Option("--gui", help="Show it in sumo-gui, until the window is closed.")] = False,
    delay: Annotated[int, typer.Option(min=0, help="With --gui: milliseconds per step; 100 is real time.")] = 100,
    quit_on_end: Annotated[
        bool, typer.Option("--quit-on-end", help="With --gui: close the window when the case is over.")
    ] = False,
    trace: Annotated[Path | None, typer.Option(help="Write every cycle to this file (.csv or .parquet).")] = None,
    video: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a video of it (.gif, or .mp4 with ffmpeg).")
    ] = None,
    stills: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Write N frames of it, evenly spread, as --stills-file.")
    ] = None,
    stills_file: Annotated[
        Path, typer.Option(metavar="FILE", help="Stills are FILE-1, FILE-2 ... (.png, .svg, .pdf).")
    ] = Path("still.png"),
    fcd: Annotated[Path | None, typer.Option(help="SUMO's floating car data (.xml).")] = None,
    ssm: Annotated[Path | None, typer.Option(help="SUMO's conflicts, braking and gaps.")] = None,
    lanechange: Annotated[Path | None, typer.Option(help="SUMO's lane changes.")] = None,
    tripinfo: Annotated[Path | None, typer.Option(help="SUMO's trip of each car.")] = None,
    collisions: Annotated[Path | None, typer.Option(help="SUMO's collisions.")] = None,
    attach: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Drive in a SUMO that runs with --remote-port.")
    ] = None,
    json: Json = False,
) -> None:
    """Run a single case; its outcome is the same as in a sweep."""
    from merge_cosim.api.run import run as run_case
    from merge_cosim.report.story import story
    from merge_cosim.scenarios.settings import parse_setting
    from merge_cosim.sumo.outputs import SumoOutputs

    if video is not None or stills is not None:
        from merge_cosim.report.film import STILLS, VIDEOS, check_file

        if video is not None:
            check_file("--video", video, VIDEOS)
        if stills is not None:
            check_file("--stills-file", stills_file, STILLS)
    done = run_case(
        scenario,
        case,
        method,
        model=model,
        settings=dict(map(parse_setting, set_ or ())) | ({"host": host} if host else {}),
        data=data,
        source=source,
        seed=seed,
        plugins=plugin or (),
        world=world,
        unchecked_ramp=unchecked_ramp,
        gui=gui,
        delay=delay,
        trace=trace,
        outputs=SumoOutputs(fcd, ssm, lanechange, tripinfo, collisions),
        attach=attach,
        stays=not quit_on_end,
    )
    if json:
        print_json(done.row)
    else:
        show_story(story(done.row))
    if video is not None:
        done.video(video)
    if stills is not None:
        done.stills(stills, stills_file)


@app.command()
def export(
    scenario: Scenario,
    case: Annotated[str, typer.Option(help="Case, as in the column 'case' of results.parquet.")],
    out: Annotated[Path, typer.Option(help="Folder to write to.")],
    commonroad: Annotated[bool, typer.Option("--commonroad", help="Write a CommonRoad scenario instead.")] = False,
    method: Annotated[
        str | None, typer.Option(help="With --commonroad: the method that drives the host (acc, if not given).")
    ] = None,
    model: Model = None,
    set_: Sets = None,
    data: Data = None,
    source: ForceSource = None,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Write one case as SUMO files, or as a CommonRoad scenario.

    Net, route file and .sumocfg can be changed, and run by SUMO or by merge-cosim.

    With --commonroad: run the case and write it as a CommonRoad scenario, with the host as its planning problem.
    """
    from merge_cosim.api.studies import export as export_case
    from merge_cosim.scenarios.settings import parse_setting

    file = export_case(
        scenario,
        case,
        out,
        commonroad=commonroad,
        method=method,
        model=model,
        settings=dict(map(parse_setting, set_ or ())),
        data=data,
        source=source,
        seed=seed,
    )
    answer({"commonroad" if commonroad else "sumocfg": str(file)}, file, json)


@app.command()
def train(
    out: Annotated[Path, typer.Option(help="Model file to write (.json); with --splits or --folds a folder.")],
    data: Data = None,
    site: Annotated[str, typer.Option(help="Site to train on: a shipped ramp, or a folder with site.toml.")] = "us101",
    source: ForceSource = None,
    split: Annotated[Literal["car", "pair"], typer.Option(help="What is kept together on one side.")] = "car",
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the split.")] = 0,
    splits: Annotated[int, typer.Option(help="Train so many models, each on another third.", min=0)] = 0,
    folds: Annotated[int, typer.Option(help="Train so many models, each on all cars but one part's.", min=0)] = 0,
    everything: Annotated[bool, typer.Option("--all", help="Train on all pairs, none is left to judge.")] = False,
    json: Json = False,
) -> None:
    """Learn a model from recorded cars, and judge it on others.

    Speed transitions, times to arrival and the prior are counted from one third of a site's pairs.

    With --splits or --folds several models go into a folder, for `sweep --model FOLDER`.
    """
    from merge_cosim.api import studies

    if splits or folds:
        made = studies.train_ensemble(out, site=site, data=data, source=source, seed=seed, splits=splits, folds=folds)
        print_json(made.to_dict("records")) if json else show_table(
            cast(Any, made.to_dict("records")), f"models in {out}"
        )
        return
    trained = studies.train(out, site=site, data=data, source=source, split=split, seed=seed, everything=everything)
    report = trained.report
    if json:
        print_json(report)
    else:
        typer.echo(
            f"{out}: trained on {report['train_pairs']} pairs of {report['train_cars']} cars ({report['source']})"
        )
        show_table(report["held_out"], "held-out merging cars, by distance to the merging point")
        show_table(report["densities"], "-log P(V_t | V_t-1, I) per transition of held-out cars; less is better")


def refusal(error: Exception) -> str | None:
    """The one line for what a user can mend; None for an error of our own."""
    if isinstance(error, UserError):
        return str(error)
    if isinstance(error, OSError):  # a full disk, a folder without permission: wherever it strikes
        return f"{error.filename}: cannot be read or written ({error.strerror})" if error.filename else str(error)
    if isinstance(error, MemoryError) or "failed to map segment" in str(error):  # of a library that is loaded late
        return "not enough memory; try fewer --jobs, or fewer cases"
    from merge_cosim.core.registry import plugin_error

    line = plugin_error(error)
    return str(line) if line else None


@cache
def _command() -> Any:
    """The application as typer builds it, once for all calls in a process."""
    return typer.main.get_command(app)


def main() -> None:
    """Run the command line; a user's mistake is one line and exit status 2."""
    import atexit
    import gc
    import io
    import os
    import sys

    # What is imported stays: to search it again and again, and once more at the end, takes a sixth of a short command.
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    ended_by_signal()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal may lack a character, such as a dash
    if any(not word or EMPTY.fullmatch(word) for word in sys.argv[1:]):
        die("an argument is empty, as where a variable of the shell is not set (see --help)")
    for name in ("LIBSUMO_AS_TRACI", "LIBTRACI_AS_TRACI"):
        os.environ.pop(name, None)  # with them `import traci` gives another module, and prints that it does
    try:
        sys.exit(_command()(standalone_mode=False))
    except USAGE_ERROR as error:
        message = error.format_message()
        if "\n" in message:  # the help, for want of any argument
            error.show()
            sys.exit(2)
        die(f"{message} (see --help)")
    except Exception as error:
        if (line := refusal(error)) is None:
            raise
        die(line)


if __name__ == "__main__":
    main()

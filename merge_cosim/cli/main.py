"""The command `merge-cosim`: options and printing, no logic. Heavy imports wait until a command needs them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from merge_cosim.cli import ngsim, ramp
from merge_cosim.cli.show import die, print_json, show_table
from merge_cosim.errors import UserError

app = typer.Typer(
    help=__import__("merge_cosim").__doc__,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(ngsim.app, name="ngsim")
app.add_typer(ramp.app, name="ramp")

SHOWN = (
    *("scenario", "variation", "site", "source", "method", "n", "failures", "failure_pct", "ci_low_pct", "ci_high_pct"),
    *("censored", "host_not_reached", "distance_m", "delay_s", "hardest_braking", "unnecessary_yields", "cycle_us"),
)
"""Columns of the summary that fit a terminal."""

USAGE_ERROR = cast("type[typer.BadParameter]", typer.BadParameter.__base__)
"""typer's UsageError; typer gives it no public name."""

Source = Literal["ngsim", "surrogate"]
Start = Literal["spawn", "fork"]
Data = Annotated[Path | None, typer.Option(help="Folder with NGSIM files (else $MERGE_COSIM_DATA, else ./data).")]
Model = Annotated[str | None, typer.Option(help="Model file, or name of a model that comes with the project.")]
Sets = Annotated[list[str] | None, typer.Option("--set", help="NAME=VALUE, such as acc.headway=1.2 or test.horizon=5.")]
Plugins = Annotated[list[Path] | None, typer.Option(help="Python file with components of your own.")]
Against = Annotated[
    str | None, typer.Option(help="Method to compare the others with on the same cases; pgm if it was run.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Seed = Annotated[int, typer.Option(help="Seed of SUMO and of every random stream.")]


@app.command()
def sweep(
    scenarios: Annotated[list[str], typer.Argument(metavar="SCENARIO...", help="Shipped scenarios or scenario files.")],
    method: Annotated[
        list[str] | None, typer.Option(help="Estimator, or estimator+controller; all if not given.")
    ] = None,
    model: Model = None,
    set_: Sets = None,
    vary: Annotated[list[str] | None, typer.Option(help="NAME=A:B:STEP or NAME=X,Y,Z; one at a time.")] = None,
    data: Data = None,
    source: Annotated[Source | None, typer.Option(help="Force real data or the surrogate.")] = None,
    seed: Seed = 0,
    plugin: Plugins = None,
    against: Against = None,
    out: Annotated[Path, typer.Option(help="Result folder.")] = Path("out"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; one per core by default.")] = None,
    start: Annotated[Start, typer.Option(help="How processes are started.")] = "spawn",
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to run on, or 'local'.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Finish an interrupted sweep.")] = False,
    json: Json = False,
) -> None:
    """Run scenarios under methods and store one row per case."""
    import os

    from merge_cosim.cli.progress import sweep_progress
    from merge_cosim.experiments.methods import parse_setting, parse_variation
    from merge_cosim.experiments.plan import SweepRequest
    from merge_cosim.experiments.sweep import sweep as run_sweep
    from merge_cosim.ngsim.data import find_data

    request = SweepRequest(
        scenarios=scenarios,
        methods=method or (),
        model=model,
        settings=dict(map(parse_setting, set_ or ())),
        variations=[parse_variation(text) for text in vary or ()],
        data=find_data(data),
        source=source,
        seed=seed,
        plugins=plugin or (),
        jobs=jobs or os.cpu_count() or 1,
        start=start,
        dask=dask,
        against=against,
    )
    try:
        with sweep_progress() as progress:
            run_sweep(request, out, resume, progress)
    except KeyboardInterrupt:
        typer.echo(f"interrupted: what was finished is kept in {out}; go on with --resume", err=True)
        raise typer.Exit(130) from None
    from merge_cosim.experiments.store import MANIFEST, SUMMARY_JSON, ResultFolder

    folder = ResultFolder(out)
    if json:
        print_json({"summary": folder.read_json(SUMMARY_JSON), "manifest": folder.read_json(MANIFEST)})
    else:
        rows = [{name: row[name] for name in SHOWN} for row in folder.read_json(SUMMARY_JSON)]
        show_table(rows, f"{out}: {', '.join(scenarios)}")


@app.command()
def run(
    scenario: Annotated[str, typer.Argument(help="Shipped scenario or scenario file.")],
    case: Annotated[str, typer.Option(help="Case, as in the column 'case' of results.parquet.")],
    method: Annotated[str, typer.Option(help="Estimator, or estimator+controller.")],
    model: Model = None,
    set_: Sets = None,
    data: Data = None,
    source: Annotated[Source | None, typer.Option(help="Force real data or the surrogate.")] = None,
    seed: Seed = 0,
    plugin: Plugins = None,
    gui: Annotated[bool, typer.Option("--gui", help="Show it in sumo-gui.")] = False,
    delay: Annotated[int, typer.Option(help="With --gui: milliseconds per step.")] = 100,
    trace: Annotated[Path | None, typer.Option(help="Write every cycle to this file (.csv or .parquet).")] = None,
    json: Json = False,
) -> None:
    """Run one case alone; its outcome is the same as in a sweep."""
    from merge_cosim.experiments.methods import parse_setting
    from merge_cosim.experiments.plan import SweepRequest
    from merge_cosim.experiments.single import run_single
    from merge_cosim.ngsim.data import find_data

    request = SweepRequest(
        scenarios=[scenario],
        methods=[method],
        model=model,
        settings=dict(map(parse_setting, set_ or ())),
        data=find_data(data),
        source=source,
        seed=seed,
        plugins=plugin or (),
    )
    row = run_single(request, case, gui_delay=delay if gui else None, trace=trace)
    if json:
        print_json(row)
    else:
        for name, value in row.items():
            typer.echo(f"{name:18} {value}")


@app.command()
def export(
    scenario: Annotated[str, typer.Argument(help="Shipped scenario or scenario file.")],
    case: Annotated[str, typer.Option(help="Case, as in the column 'case' of results.parquet.")],
    out: Annotated[Path, typer.Option(help="Folder to write to.")],
    set_: Sets = None,
    data: Data = None,
    source: Annotated[Source | None, typer.Option(help="Force real data or the surrogate.")] = None,
    json: Json = False,
) -> None:
    """Write one case as ordinary SUMO files: net, route file and .sumocfg, to be changed and run by SUMO or by us."""
    from merge_cosim.experiments.methods import parse_setting
    from merge_cosim.experiments.plan import SweepRequest
    from merge_cosim.experiments.single import export_case
    from merge_cosim.ngsim.data import find_data

    settings = dict(map(parse_setting, set_ or ()))
    request = SweepRequest([scenario], ["acc"], settings=settings, data=find_data(data), source=source)
    file = export_case(request, case, out)
    if json:
        print_json({"sumocfg": str(file)})
    else:
        typer.echo(file)


@app.command()
def train(
    out: Annotated[Path, typer.Option(help="Model file to write (.json).")],
    data: Data = None,
    site: Annotated[Literal["us101", "i80"], typer.Option(help="Site to train on.")] = "us101",
    source: Annotated[Source | None, typer.Option(help="Force real data or the surrogate.")] = None,
    split: Annotated[Literal["car", "pair"], typer.Option(help="What is kept together on one side.")] = "car",
    seed: Annotated[int, typer.Option(help="Seed of the split.")] = 0,
    json: Json = False,
) -> None:
    """Learn speed transitions, times to arrival and the prior from one third of a site's pairs, and judge the rest."""
    from merge_cosim.experiments.training import train as train_model
    from merge_cosim.ngsim.data import find_data

    report = train_model(site, find_data(data), source, split, seed, out)
    if json:
        print_json(report)
    else:
        typer.echo(
            f"{out}: trained on {report['train_pairs']} pairs of {report['train_cars']} cars ({report['source']})"
        )
        show_table(report["held_out"], "held-out merging cars, by distance to the merging point")
        show_table(report["densities"], "-log P(V_t | V_t-1, I) per transition of held-out cars; less is better")


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Result folder of a sweep.")],
    against: Against = None,
    json: Json = False,
) -> None:
    """Make one offline HTML page of a sweep: tables, failure maps, one case in detail."""
    from merge_cosim.report.page import write_report

    file = write_report(folder, against)
    if json:
        print_json({"report": str(file)})
    else:
        typer.echo(file)


@app.command()
def bench(
    cases: Annotated[int, typer.Option(min=1, help="Cases that our loop runs.")] = 2_000,
    sample: Annotated[int, typer.Option(min=1, help="Of them, how many each alternative runs.")] = 100,
    rounds: Annotated[int, typer.Option(min=1, help="How often each is timed; the median counts.")] = 5,
    largest: Annotated[int, typer.Option(min=1, help="Cases of the largest sweep.")] = 100_000,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; one per core by default.")] = None,
    page: Annotated[Path | None, typer.Option(help="Write the figures as a page in Markdown, too.")] = None,
    json: Json = False,
) -> None:
    """Time the loop, its alternatives, every estimator, and sweeps by cases and processes."""
    from merge_cosim.bench import bench as figures

    found = figures.bench(cases, sample, rounds, largest, jobs)
    command = f"merge-cosim bench --cases {cases} --sample {sample} --rounds {rounds} --largest {largest}"
    if page is not None:
        figures.write_page(page, found, command)
    if json:
        print_json(found)
    else:
        typer.echo(figures.page(found, command))


@app.command()
def bounds(
    scenario: Annotated[str, typer.Argument(help="Replay scenario, or its file.")],
    set_: Sets = None,
    data: Data = None,
    source: Annotated[Source | None, typer.Option(help="Force real data or the surrogate.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write one row per case to this .csv file.")] = None,
    json: Json = False,
) -> None:
    """Count the cases of a replay that no host could pass without a failure, or not without a long delay."""
    from merge_cosim.experiments.bounds import bounds_of
    from merge_cosim.experiments.methods import parse_setting
    from merge_cosim.ngsim.data import find_data

    cases, rows = bounds_of(scenario, dict(map(parse_setting, set_ or ())), find_data(data), source)
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        cases.to_csv(out, index=False)
    if json:
        print_json(rows)
    else:
        show_table(rows, f"{scenario}: what any host could have done")


@app.command()
def methods(plugin: Plugins = None, json: Json = False) -> None:
    """List estimators, controllers and merging cars with their parameters."""
    from merge_cosim.experiments.catalogue import components

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
    from merge_cosim.experiments.scenario import load_scenario, scenario_names

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

    from merge_cosim.files import cache_folder

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


def main() -> None:
    """Run the command line; a user's mistake is one line and exit status 2."""
    import sys

    try:
        sys.exit(app(standalone_mode=False))
    except USAGE_ERROR as error:
        message = error.format_message()
        if "\n" in message:  # the help, for want of any argument
            error.show()
            sys.exit(2)
        die(f"{message} (see --help)")
    except UserError as error:
        die(str(error))
    except OSError as error:  # a full disk, a folder without permission: the user's to mend, wherever it strikes
        die(f"{error.filename}: cannot be read or written ({error.strerror})" if error.filename else str(error))


if __name__ == "__main__":
    main()

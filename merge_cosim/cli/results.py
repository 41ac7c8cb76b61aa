"""`merge-cosim report`, `summary`, `compare`, `cases`, `verify`, `reproduce`, `bounds`, `bench`: from results."""

from pathlib import Path
from typing import Annotated

import typer

from merge_cosim.cli.options import (
    MOST_SEED,
    Against,
    Columns,
    Data,
    ForceSource,
    Jobs,
    Json,
    Model,
    Plugins,
    Seed,
    Sets,
    Wide,
    World,
)
from merge_cosim.cli.show import (
    answer,
    print_json,
    show_results,
    show_short_table,
    show_table,
    show_verdict,
    show_verification,
    verification,
)
from merge_cosim.core.errors import UserError

app = typer.Typer()


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Result folder of a sweep.")],
    against: Against = None,
    figures: Annotated[
        Path | None,
        typer.Option(help="Write every figure as SVG, PDF, PNG and CSV, and the tables, to this folder instead."),
    ] = None,
    width: Annotated[float | None, typer.Option(min=4.0, max=60.0, help="With --figures: their width [cm].")] = None,
    font_size: Annotated[float, typer.Option(min=4.0, max=24.0, help="With --figures: size of the type [pt].")] = 9.0,
    columns: Annotated[
        str | None,
        typer.Option(help="With --figures: columns of the tables of outcomes: n,failure_pct,delay_s."),
    ] = None,
    json: Json = False,
) -> None:
    """Make one offline HTML page of a sweep, or figures for a paper.

    The page has the verdict, tables, failure maps and recorded cases.
    """
    from merge_cosim.api.results import Results

    results = Results(folder)
    if figures is not None:
        files = results.figures(figures, width, font_size, columns.split(",") if columns else ())
        answer({"files": [str(file) for file in files]}, f"{len(files)} files in {figures}", json)
        return
    file = results.report(against=against)
    answer({"report": str(file)}, file, json)


@app.command()
def summary(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Result folder of a sweep.")],
    wide: Wide = False,
    columns: Columns = None,
    verdict: Annotated[bool, typer.Option("--verdict", help="Show only the verdicts.")] = False,
    json: Json = False,
) -> None:
    """Show the table and the verdict of a finished sweep again."""
    from merge_cosim.results.store import ResultFolder

    if json:
        print_json(ResultFolder(folder).summary())
    elif verdict:
        from merge_cosim.report.short_table import short_tables

        for table in short_tables(folder):
            show_verdict(table)
    else:
        show_results(folder, wide, columns)


@app.command()
def compare(
    first: Annotated[str, typer.Argument(metavar="A", help="Result folder, or DIR:METHOD (DIR:METHOD@MODEL).")],
    second: Annotated[str, typer.Argument(metavar="B", help="Another, or another method of the same or another.")],
    out: Annotated[Path | None, typer.Option(help="Folder for the table as CSV and LaTeX.")] = None,
    wide: Wide = False,
    json: Json = False,
) -> None:
    """Set two methods, or two sweeps, side by side.

    They may be of any folders; what both hold is compared.
    """
    from merge_cosim.report.comparison import compare as compare_folders
    from merge_cosim.report.export import write_tables
    from merge_cosim.report.short_table import compared_tables

    (path_a, method_a), (path_b, method_b) = map(_side, (first, second))
    if bool(method_a) != bool(method_b):
        raise UserError(f"compare {first} {second}: name a method of both (DIR:METHOD DIR:METHOD), or of neither")
    methods = (method_a, method_b) if method_a and method_b else None
    table, differences = compare_folders(path_a, path_b, methods)
    files = [] if out is None else write_tables(out, {"comparison": table})
    if json:
        rows = table.data.astype(object).where(table.data.notna(), None).to_dict("records")
        print_json({"rows": rows, "differences": differences, "files": [str(file) for file in files]})
        return
    if wide:
        headings = [" ".join(filter(None, (column.group, column.heading))) for column in table.columns]
        show_table([dict(zip(headings, row, strict=True)) for row in table.cells], table.title)
    else:
        typer.echo(table.title)
        for part in compared_tables(table):
            show_short_table(part)
    for line in differences:
        typer.echo(line)


def _side(text: str) -> tuple[Path, str | None]:
    """A folder, and the method named behind it."""
    folder, colon, method = text.rpartition(":")
    return (Path(folder), method) if colon and not Path(text).is_dir() else (Path(text), None)


@app.command()
def cases(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Result folder of a sweep.")],
    where: Annotated[str | None, typer.Option(help="Condition on columns of results.parquet.")] = None,
    fails: Annotated[list[str] | None, typer.Option(help="Method under which the case fails; several: all.")] = None,
    passes: Annotated[
        list[str] | None, typer.Option("--not", help="Method under which it is carried to the end without failure.")
    ] = None,
    limit: Annotated[int, typer.Option(min=0, help="Most cases to list; 0, or --json: all.")] = 20,
    json: Json = False,
) -> None:
    """List cases, each as the command that runs it.

    Such as --where "failed and method == 'pgm'", or --fails pgm --not acc.
    """
    from merge_cosim.api.results import load_results

    results = load_results(folder)
    rows = results.cases(where, fails or (), passes or ())
    shown = rows.head(limit) if limit and not json else rows
    commands = results.run_commands(shown)
    if json:
        listed = shown.astype(object).where(shown.notna(), None).to_dict("records")
        print_json([row | {"command": command} for row, command in zip(listed, commands, strict=True)])
        return
    for command in commands:
        typer.echo(command)
    more = f"; {len(rows) - len(shown):,} are not shown (--limit 0)" if len(shown) < len(rows) else ""
    typer.echo(f"{len(rows):,} of {len(results):,} rows{more}", err=True)


@app.command()
def verify(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Result folder of a sweep.")],
    share: Annotated[float, typer.Option(help="Share of the rows of each scenario, variation and method.")] = 0.05,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the choice of rows.")] = 0,
    tolerance: Annotated[
        float | None,
        typer.Option(help="Largest difference of a measure; 1e-4 for rows of the closed form, else 0, if not given."),
    ] = None,
    data: Data = None,
    model: Model = None,
    plugin: Plugins = None,
    jobs: Jobs = None,
    json: Json = False,
) -> None:
    """Run a share of a sweep's rows again in SUMO and compare.

    The exit status is 1 if they differ beyond the tolerance.
    """
    from merge_cosim.api.results import Results

    found = Results(folder).verify(
        share, seed=seed, data=data, model=model, plugins=plugin or (), jobs=jobs, tolerance=tolerance
    )
    if json:
        print_json(verification(found))
    else:
        show_verification(found)
    if found.beyond:
        raise typer.Exit(1)


@app.command()
def reproduce(
    data: Data = None,
    out: Annotated[Path, typer.Option(help="Folder for results, models, tables and the page.")] = Path("reproduction"),
    jobs: Jobs = None,
    seed: Seed = 0,
    world: World = "sumo",
    json: Json = False,
) -> None:
    """Make every table and figure of the papers, ours beside theirs.

    One HTML page holds them; a second call goes on where the first ended.
    """
    from merge_cosim.api.studies import reproduce as run_studies
    from merge_cosim.cli.interrupts import resumable

    with resumable(f"what was finished is kept in {out}; the same command goes on"):
        file, studies = run_studies(out, data=data, jobs=jobs, seed=seed, world=world)
    document = {"report": str(file), "studies": {name: str(study.path) for name, study in studies.items()}}
    answer(document, file, json)


@app.command()
def bounds(
    scenario: Annotated[str, typer.Argument(help="Scenario of two cars, or its file.")],
    set_: Sets = None,
    data: Data = None,
    source: ForceSource = None,
    out: Annotated[Path | None, typer.Option(help="Write one row per case to this .csv file.")] = None,
    json: Json = False,
) -> None:
    """Bound what any host could have done: failures and delays."""
    from merge_cosim.api.studies import bounds as bounds_of
    from merge_cosim.scenarios.settings import parse_setting

    cases, counts = bounds_of(scenario, settings=dict(map(parse_setting, set_ or ())), data=data, source=source)
    rows = [{str(name): value for name, value in row.items()} for row in counts.to_dict("records")]
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        cases.to_csv(out, index=False)
    if json:
        print_json(rows)
    else:
        places = [" ".join(str(row.pop(name)) for name in ("site", "source")) for row in rows]
        lines = [{"": name} | {place: row[name] for place, row in zip(places, rows, strict=True)} for name in rows[0]]
        show_table(lines[1:], f"{scenario}: what any host could have done")


@app.command()
def bench(
    cases: Annotated[int, typer.Option(min=1, help="Cases that our loop runs.")] = 2_000,
    sample: Annotated[int, typer.Option(min=1, help="Of them, how many each alternative runs.")] = 100,
    rounds: Annotated[int, typer.Option(min=1, help="How often each is timed; the median counts.")] = 5,
    largest: Annotated[int, typer.Option(min=1, help="Cases of the largest sweep.")] = 100_000,
    jobs: Jobs = None,
    copies: Annotated[int, typer.Option(min=1, help="Copies of the ramp that living traffic is timed on.")] = 16,
    only: Annotated[list[str] | None, typer.Option(help="Part to take, several times for several.")] = None,
    commonroad_python: Annotated[
        Path | None, typer.Option(help="Python of an environment with commonroad-sumo and eclipse-sumo: time it, too.")
    ] = None,
    other: Annotated[
        Path | None, typer.Option(help="Checkout of another version: run one sweep by both, in turns.")
    ] = None,
    against: Annotated[
        Path | None, typer.Option(help="JSON of an earlier bench: compare ratios; status 1 if one fell by 15 %.")
    ] = None,
    page: Annotated[
        Path | None, typer.Option(help="Write the figures as a page in Markdown, and as JSON beside it.")
    ] = None,
    json: Json = False,
) -> None:
    """Time the loop, other simulators, estimators and whole sweeps."""
    from merge_cosim.bench import bench as figures
    from merge_cosim.bench import regression

    before = None if against is None else regression.read_figures(against)
    found = figures.bench(cases, sample, rounds, largest, jobs, copies, only or (), commonroad_python, other)
    command = (
        f"merge-cosim bench --cases {cases} --sample {sample} --rounds {rounds} --largest {largest} --copies {copies}"
    )
    command += "".join(f" --only {part}" for part in only or ())
    named = {"--jobs": jobs, "--commonroad-python": commonroad_python and "PYTHON", "--other": other and "CHECKOUT"}
    command += "".join(f" {option} {value}" for option, value in named.items() if value is not None)
    for part in found["load"]:
        if crowded := figures.crowded(found, part):
            typer.echo(f"{part}: {crowded.strip().strip('*')}", err=True)
    if page is not None:
        figures.write_page(page, found, command, before)
    answer(found, figures.page(found, command, before), json)
    worse = [row for row in regression.against(found, before, figures.TOLERANCE) if row["worse"]] if before else []
    for row in worse:
        typer.echo(f"{row['ratio']}: {row['before']} before, {row['now']} now", err=True)
    if worse:
        raise typer.Exit(1)

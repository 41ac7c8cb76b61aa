"""What is fuzzed: a target writes a damaged input, has it read, and compares what was taken with a second reading."""

from __future__ import annotations

import contextlib
import functools
import io
import random
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from unittest.mock import patch

import fuzz_oracles as oracles
from fuzz_inputs import (
    CONFIG,
    GRID,
    PLUGIN,
    ROUTES,
    changed_bytes,
    damaged,
    damaged_parquet,
    episode_table,
    trajectories,
    trajectory_table,
)

from merge_cosim.api.results import Results
from merge_cosim.cli.main import main
from merge_cosim.core.files import cache_folder, shipped
from merge_cosim.estimators.learned.model import MODELS, IntentionModel
from merge_cosim.ngsim.data import cached
from merge_cosim.ngsim.formats import TEXT_COLUMNS
from merge_cosim.ngsim.pairing.episodes import episode_tracks
from merge_cosim.ngsim.read import read_file
from merge_cosim.ngsim.sites import read_site, site
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.view import netedit_view
from merge_cosim.results.files import csv_rows, read_json
from merge_cosim.scenarios.encounters import load_encounters
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.scenarios.settings import parse_setting, parse_variation
from merge_cosim.sumo.configuration import Configuration
from merge_cosim.sumo.route_reader import read_pairs
from merge_cosim.sweeps.plan import SweepRequest, plan

EXTRACT = Path(__file__).parents[1] / "docs" / "files" / "rosenbach.osm"
CASE = ("--case", "d+0_h15_m15", "--world", "closed-form")

Check = Callable[[], None]
"""Reads the input a second time; raises `Wrong`."""

Reading = Callable[[], Check | None]
"""Reads the input in the present folder, and raises what the package raises; returns how to check what was taken."""


class Refused(Exception):
    """The command ended with status 2 and these lines."""


@dataclass(frozen=True)
class Target:
    """A kind of input.

    Attributes:
        name: What it is called.
        make: Writes an input into a folder and returns what reads it.
        names: What the line of a refusal must name: the file, as a regular expression.
        share: Inputs of this kind in each turn.
    """

    name: str
    make: Callable[[Path, random.Random], Reading]
    names: str = ""
    share: int = 1


def command(*words: str) -> Reading:
    """The whole command, in this process."""

    def run() -> None:
        said, printed = io.StringIO(), io.StringIO()
        status = 0
        with patch.object(sys, "argv", ["merge-cosim", *words]), contextlib.redirect_stdout(printed):
            try:
                with contextlib.redirect_stderr(said):
                    main()
            except SystemExit as end:
                status = int(end.code or 0)
        if status == 2:
            raise Refused("\n".join(line for line in said.getvalue().splitlines() if line.startswith("merge-cosim: ")))
        if status not in (0, 1):
            raise AssertionError(f"status {status}: {said.getvalue()}")

    return run


def _trajectories(name: str, content: bytes, header: bool) -> Callable[[Path, random.Random], Reading]:
    def make(folder: Path, rng: random.Random) -> Reading:
        file, written = folder / name, damaged(content, rng)
        file.write_bytes(written)
        given = rng.choice((site("us101"), None))
        names = None if header else TEXT_COLUMNS
        return lambda: partial(oracles.trajectories, read_file(Path(name), given), oracles.text_rows(written, names))

    return make


def _parquet(folder: Path, rng: random.Random) -> Reading:
    file = Path("t.parquet")
    (folder / file).write_bytes(damaged_parquet(trajectory_table(), rng))
    return lambda: partial(oracles.trajectories, read_file(file, site("us101")), oracles.parquet_rows(file))


def _episodes(folder: Path, rng: random.Random) -> Reading:
    file = Path("e.parquet")
    (folder / file).write_bytes(damaged_parquet(episode_table(), rng))
    us101 = site("us101")
    return lambda: partial(oracles.episodes, episode_tracks(file, us101, us101.pairs), file)


def _ngsim(folder: Path, rng: random.Random) -> Reading:
    (folder / "t.csv").write_bytes(damaged(trajectories(",", True, rng.random() < 0.5), rng))
    return command("ngsim", *rng.choice((("summary", "t.csv"), ("import", "t.csv", "--out", "o", "--json"))))


def _scenario(folder: Path, rng: random.Random) -> Reading:
    file = Path("s.toml")
    (folder / file).write_bytes(damaged(GRID.encode(), rng))

    def read() -> Check:
        scenario = load_scenario(file)
        if scenario.encounters.kind == "grid":
            encounters = load_encounters(scenario, None, None)
            return lambda: (oracles.same_toml(scenario, file), oracles.grid(encounters, file))[0]
        return lambda: oracles.same_toml(scenario, file)

    return read


def _ramp(name: str) -> Callable[[Path, random.Random], Reading]:
    """A damaged file of the designed ramp."""

    def make(folder: Path, rng: random.Random) -> Reading:
        source = shipped("sumo_nets") / "designed"
        for file in ("ramp.toml", "designed.net.xml"):
            content = (source / file).read_bytes()
            (folder / file).write_bytes(damaged(content, rng) if file == name else content)
        return lambda: partial(oracles.ramp, Ramp.load("."), Path("designed.net.xml"), Path("ramp.toml"))

    return make


def _site(folder: Path, rng: random.Random) -> Reading:
    (folder / "site.toml").write_bytes(damaged((shipped("sumo_nets") / "us101" / "site.toml").read_bytes(), rng))
    return lambda: partial(oracles.same_toml, read_site(Path()), Path("site.toml"))


def _routes(folder: Path, rng: random.Random) -> Reading:
    net, file = shipped("sumo_nets") / "designed" / "designed.net.xml", Path("my.rou.xml")
    (folder / file).write_bytes(damaged(ROUTES.encode(), rng))
    configuration = Configuration(Path("my.sumocfg"), net, (file,), (), 0.0, 60.0)

    def read() -> Check:
        ramp, encounters = read_pairs(configuration)
        return lambda: oracles.routes(encounters, file, ramp)

    return read


def _in_sumo(name: str) -> Callable[[Path, random.Random], Reading]:
    """A damaged file of a ramp and its configuration, driven in SUMO."""

    def make(folder: Path, rng: random.Random) -> Reading:
        shutil.copytree(shipped("sumo_nets") / "designed", folder, dirs_exist_ok=True)
        (folder / "my.rou.xml").write_text(ROUTES)
        (folder / "my.sumocfg").write_text(CONFIG)
        (folder / name).write_bytes(damaged((folder / name).read_bytes(), rng))
        return command("run", "my.sumocfg", "--case", "h0_m0", "--method", "acc", "--json", "--unchecked-ramp")

    return make


def _built(name: str) -> Callable[[Path, random.Random], Reading]:
    """A damaged source of a net, built by netconvert."""

    def make(folder: Path, rng: random.Random) -> Reading:
        shutil.copytree(shipped("sumo_nets") / "designed", folder, dirs_exist_ok=True)
        (folder / name).write_bytes(damaged((folder / name).read_bytes(), rng))
        return command("ramp", "build", ".")

    return make


def _described(folder: Path, rng: random.Random) -> Reading:
    net = (shipped("sumo_nets") / "us101" / "us101.net.xml").read_bytes()
    (folder / "my.net.xml").write_bytes(damaged(net, rng))
    return command("ramp", *rng.choice((("describe", "my.net.xml"), ("new", "mine", "--from-net", "my.net.xml"))))


def _osm(folder: Path, rng: random.Random) -> Reading:
    (folder / "my.osm").write_bytes(damaged(EXTRACT.read_bytes(), rng))
    return command("ramp", "new", "mine", "--from-osm", "my.osm")


def _view(folder: Path, rng: random.Random) -> Reading:
    content = damaged((shipped("sumo_nets") / "designed" / "view.xml").read_bytes(), rng)
    (folder / "view.xml").write_bytes(content)
    (folder / "copy").mkdir()

    def read() -> Check:
        netedit_view(Path(), Path("copy"))
        written = content.replace(b'laneEdgeMode="32"', b'laneEdgeMode="13"')
        return lambda: oracles.same("view", Path("copy/view.xml").read_bytes(), written)

    return read


def _model(folder: Path, rng: random.Random) -> Reading:
    file = Path("m.json")
    (folder / file).write_bytes(damaged((MODELS / "us101-surrogate.json").read_bytes(), rng))
    return lambda: partial(oracles.model, IntentionModel.load(file), file)


def _set(folder: Path, rng: random.Random) -> Reading:
    good = ("acc.headway=1.2", "test.horizon=5", "speed_limit=30", "merging.ahead=any", "encounters.host_speed.step=2")
    return _settings(folder, damaged(rng.choice(good).encode(), rng).decode(errors="replace"), False)


def _vary(folder: Path, rng: random.Random) -> Reading:
    good = ("acc.headway=1:2:0.5", "test.horizon=1,2,5", "acc.headway=1.0,2.0", "merging.ahead=any,clear")
    return _settings(folder, damaged(rng.choice(good).encode(), rng).decode(errors="replace"), True)


def _settings(folder: Path, text: str, vary: bool) -> Reading:
    """A setting or a variation, as far as the plan of a sweep."""
    (folder / "s.toml").write_text(GRID)

    def read() -> Check:
        name, values = parse_variation(text) if vary else parse_setting(text)
        chosen = {"variations": [(name, values)]} if vary else {"settings": {name: values}}
        tasks = plan(SweepRequest(["s.toml"], ["acc"], world="closed-form", **chosen))
        return lambda: oracles.settings(tasks, text, vary)

    return read


def _plugin(folder: Path, rng: random.Random) -> Reading:
    (folder / "p.py").write_bytes(damaged(PLUGIN.encode(), rng))
    return command("run", "designed-2", *CASE, "--method", "mine", "--plugin", "p.py", "--json")


@functools.cache
def _sweep() -> Path:
    """The result folder of a small sweep, made once."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    (folder / "s.toml").write_text(GRID)
    words = ("--method", "acc,slot-time", "--world", "closed-form", "--jobs", "1", "--out", str(folder / "out"))
    command("sweep", str(folder / "s.toml"), *words)()
    return folder / "out"


@functools.cache
def _results() -> tuple[Results, list[dict[str, object]]]:
    results = Results(_sweep())
    return results, results.rows.to_dict("records")


def _where(folder: Path, rng: random.Random) -> Reading:
    condition = oracles.condition(rng)
    if rng.random() < 0.7:
        condition = damaged(condition.encode(), rng).decode(errors="replace")
    results, rows = _results()

    def read() -> Check:
        taken = results.cases(condition)
        return lambda: oracles.where(rows, condition, (taken["case"] + taken["method"]).tolist())

    return read


def _folder(folder: Path, rng: random.Random) -> Reading:
    """One file of a result folder damaged, and all of it read."""
    whole = _sweep()
    shutil.copytree(whole, folder / "out")
    file = rng.choice([one for one in sorted((folder / "out").iterdir()) if one.is_file()])
    change = changed_bytes if file.suffix == ".parquet" else damaged
    file.write_bytes(change(file.read_bytes(), rng))
    good = _results()[0]

    def read() -> Check:
        results = Results("out")
        taken = (results.rows, results.traces, read_json(Path("out/summary.json")))
        results.summary()
        for table in Path("out").glob("*.csv"):
            csv_rows(table)
        results.notes()
        results.run_commands(results.rows)
        return partial(oracles.results, taken, good, Path("out/summary.json"))

    return read


def _reported(folder: Path, rng: random.Random) -> Reading:
    _folder(folder, rng)
    return command(*rng.choice((("report", "out"), ("summary", "out"), ("compare", "out:acc", "out:slot-time"))))


def _cache(folder: Path, rng: random.Random) -> Reading:
    """The cached reading of a file, damaged at random bytes."""
    (folder / "t.csv").write_bytes(trajectories(",", True))

    def read() -> Check:
        with patch.dict("os.environ", MERGE_COSIM_CACHE=str(folder / "cache")):
            good = cached(Path("t.csv"))
            files = [file for file in cache_folder("ngsim").rglob("*") if file.is_file()]
            for file in rng.sample(files, rng.randint(1, 2)):
                content = file.read_bytes()
                file.write_bytes(rng.choice((changed_bytes(content, rng), content[: rng.randrange(len(content) + 1)])))

            again = cached(Path("t.csv"))
        held = {name: table.equals(good.tables[name]) for name, table in again.tables.items()}
        return lambda: oracles.same("rows and tables", (again.rows, held), (good.rows, {"us101": True}))

    return read


TARGETS = [
    Target("ngsim-text", _trajectories("t.txt", trajectories("  ", False), False), "t.txt", 30),
    Target("ngsim-csv", _trajectories("t.csv", trajectories(",", True), True), "t.csv", 30),
    Target("portal-csv", _trajectories("p.csv", trajectories(",", True, True), True), "p.csv", 30),
    Target("parquet", _parquet, "t.parquet", 30),
    Target("episodes", _episodes, "e.parquet", 40),
    Target("ngsim-command", _ngsim, "t.csv", 1),
    Target("scenario", _scenario, "s.toml", 150),
    Target("site-toml", _site, "site.toml", 150),
    Target("ramp-toml", _ramp("ramp.toml"), r"ramp\.toml|no such net", 100),
    Target("net", _ramp("designed.net.xml"), "designed.net.xml", 100),
    Target("routes", _routes, r"my\.(rou|sumocfg)", 100),
    Target("view", _view, "view.xml", 60),
    Target("model", _model, "m.json", 12),
    Target("set", _set, "", 80),
    Target("vary", _vary, "", 60),
    Target("where", _where, "where", 80),
    Target("results", _folder, "out", 5),
    Target("report", _reported, "", 1),
    Target("cache", _cache, "", 4),
    Target("plugin", _plugin, r"p\.py|merge_cosim_plugin_p|mine|Mine", 3),
    Target("routes-in-sumo", _in_sumo("my.rou.xml"), "my", 1),
    Target("sumocfg", _in_sumo("my.sumocfg"), "my.sumocfg", 1),
    Target("net-in-sumo", _in_sumo("designed.net.xml"), "", 1),
    Target("describe", _described, r"my\.net\.xml|ramps/mine", 1),
    Target("osm", _osm, r"my\.osm|ramps/mine", 1),
    Target("plain-xml", _built("designed.edg.xml"), "", 1),
    Target("netccfg", _built("designed.netccfg"), "", 1),
]

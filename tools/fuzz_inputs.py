"""Good inputs of every kind that the command reads, and how they are damaged."""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from merge_cosim.core.files import shipped
from merge_cosim.estimators.learned.model import MODELS
from merge_cosim.ngsim.formats import TEXT_COLUMNS

NUMBERS = ("nan", "inf", "-1", "1e999", "0", "99999999999999999999", "1,234", "-0.0", "0x1")
ODD = (*NUMBERS, "é", "", "true", "[]", "{}", "\0")
"""What stands in place of a number or a word."""

GRID = """title = "A coarse grid"
ramp = "designed"
[encounters]
kind = "grid"
host_offset = { from = -4, to = 4, step = 4 }
host_speed = { from = 5, to = 25, step = 10 }
merging_speed = { from = 5, to = 25, step = 10 }
[merging]
model = "designed"
[test]
horizon = 3.0
"""
ROUTES = """<routes>
<vType id="auto" length="4.6"><param key="merge-cosim.role" value="host"/></vType>
<vType id="human"><param key="merge-cosim.role" value="merging"/></vType>
<route id="through" edges="main_in main_out"/>
<vehicle id="h0" type="auto" route="through" depart="0" departPos="405" departSpeed="20"/>
<vehicle id="m0" type="human" depart="0" departPos="410" departSpeed="18"><route edges="ramp main_out"/></vehicle>
</routes>
"""
CONFIG = """<configuration><input><net-file value="designed.net.xml"/><route-files value="my.rou.xml"/></input>
<time><begin value="0"/><end value="60"/><step-length value="0.1"/></time></configuration>
"""
PLUGIN = """
from merge_cosim.estimators.base import Estimator, estimators
import numpy as np

@estimators.register
class Mine(Estimator):
    bias: float = 0.0
    def start(self, count, setting):
        self.count = count
    def update(self, seen):
        return np.where(seen.host_station > seen.merging_station, 1.0, -1.0) + self.bias
"""
CASE = ("--case", "d+0_h15_m15", "--world", "closed-form")


@dataclass(frozen=True)
class Target:
    """A kind of input: `make` writes one into a folder and returns the command that reads it."""

    name: str
    make: Callable[[Path, random.Random], tuple[str, ...]]


def damaged(content: bytes, rng: random.Random) -> bytes:
    """A text or other bytes with one to three changes."""
    for _ in range(rng.randint(1, 3)):
        content = rng.choice(_CHANGES)(content, rng)
    return content


def _bytes(content: bytes, rng: random.Random) -> bytes:
    first = rng.randrange(len(content) + 1)
    last = min(len(content), first + rng.choice((0, 1, 8, 200)))
    return content[:first] + rng.choice((b"", rng.randbytes(3), b"\xff", content[first:last] * 2)) + content[last:]


def _cut(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _lines(content: bytes, rng: random.Random) -> bytes:
    lines = content.splitlines(keepends=True) or [b""]
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(3)
    if change == 0:
        del lines[one]
    elif change == 1:
        lines.insert(other, lines[one])
    else:
        lines[one], lines[other] = lines[other], lines[one]
    return b"".join(lines)


def _word(content: bytes, rng: random.Random) -> bytes:
    words = list(re.finditer(rb'(?<=")[^"<>\n]*(?=")|[-\w.+]+', content))
    if not words:
        return content
    word, other = rng.choice(words), rng.choice(words)
    new = rng.choice([*(odd.encode() for odd in ODD), other[0]])
    return content[: word.start()] + new + content[word.end() :]


_CHANGES = (_word, _word, _word, _lines, _bytes, _cut)


def trajectories(separator: str, header: bool, location: bool = False) -> bytes:
    """Two cars of US-101, the first of which merges."""
    rows = []
    for car, lane, y in ((1, 6, 600.0), (2, 5, 590.0)):
        for frame in range(80):
            here = 5 if car == 1 and frame > 40 else lane
            values = [car, frame, 80, 1118846978900 + 100 * frame, 52.2, y + 4.0 * frame, 6451800.0, 1872700.0]
            values += [15.5, 6.0, 2, 40.0, 0.0, here, 0, 0, 0.0, 0.0]
            rows.append(separator.join([*map(str, values), *(["us-101"] if location else [])]))
    names = [separator.join([*TEXT_COLUMNS, *(["Location"] if location else [])])] if header else []
    return ("\n".join([*names, *rows]) + "\n").encode()


def _trajectory_file(name: str, content: bytes) -> Callable[[Path, random.Random], tuple[str, ...]]:
    def make(folder: Path, rng: random.Random) -> tuple[str, ...]:
        (folder / name).write_bytes(damaged(content, rng))
        further = rng.choice(
            (("summary", name), ("import", name, "--out", "o", "--json"), ("import", name, "--out", "o"))
        )
        return ("ngsim", *further, *rng.choice(((), ("--site", "us101"))))

    return make


def _parquet(folder: Path, rng: random.Random) -> tuple[str, ...]:
    import io

    import pyarrow as pa
    import pyarrow.parquet as pq
    from pyarrow import csv

    table = csv.read_csv(io.BytesIO(trajectories(",", True, True)), csv.ReadOptions(use_threads=False))
    name = "t.parquet"
    if rng.random() < 0.3:
        numbers = {"episode": 50, "frame": 0, "car": 0, "station_m": -50.0, "speed_m_s": 10.0}
        table = pa.table({key: np.arange(30) if key == "frame" else np.full(30, v) for key, v in numbers.items()})
    for _ in range(rng.randint(1, 2)):
        at = rng.randrange(table.num_columns)
        column, n = table.column_names[at], table.num_rows
        other = rng.choice(
            (
                pa.array([[1.0]] * n),
                pa.array([None] * n),
                pa.array(["x"] * n),
                pa.array([{"a": 1}] * n),
                pa.array(np.full(n, rng.choice((np.nan, np.inf, -1.0, 1e300)))),
                pa.array([b"\xff"] * n),
                pa.array([True] * n),
                pa.array(rng.choices(range(-5, 5000), k=n)),
            )
        )
        change = rng.randrange(4)
        if change == 0 and table.num_columns > 1:
            table = table.remove_column(at)
        elif change == 1:
            table = table.append_column(rng.choice((column, column.upper())), table[column])
        else:
            table = table.set_column(at, column, other)
    pq.write_table(table.slice(0, rng.choice((0, 1, n, n))), folder / name)
    if rng.random() < 0.3:
        (folder / name).write_bytes(_bytes((folder / name).read_bytes(), rng))
    return ("ngsim", *rng.choice((("summary", name), ("import", name, "--out", "o", "--json"))), "--site", "us101")


def _scenario(folder: Path, rng: random.Random) -> tuple[str, ...]:
    (folder / "s.toml").write_bytes(damaged(GRID.encode(), rng))
    return ("run", "s.toml", *CASE, "--method", "acc", "--json")


def _ramp(name: str) -> Callable[[Path, random.Random], tuple[str, ...]]:
    """A damaged file of the designed ramp, driven in SUMO from route files or built anew."""

    def make(folder: Path, rng: random.Random) -> tuple[str, ...]:
        shutil.copytree(shipped("sumo_nets") / "designed", folder, dirs_exist_ok=True)
        (folder / "my.rou.xml").write_text(ROUTES)
        (folder / "my.sumocfg").write_text(CONFIG)
        file = folder / name
        file.write_bytes(damaged(file.read_bytes(), rng))
        if name.startswith("designed.") and "net.xml" not in name:
            return ("ramp", "build", ".")
        return ("run", "my.sumocfg", "--case", "h0_m0", "--method", "acc", "--json")

    return make


def _model(folder: Path, rng: random.Random) -> tuple[str, ...]:
    content = (MODELS / "us101-surrogate.json").read_bytes()
    (folder / "m.json").write_bytes(damaged(content, rng))
    return (
        "run",
        "designed-2",
        *CASE,
        "--method",
        rng.choice(("pgm", "pgm-g", "dbn-pf")),
        "--model",
        "m.json",
        "--json",
    )


def _words(folder: Path, rng: random.Random) -> tuple[str, ...]:
    good = ("acc.headway=1.2", "test.horizon=5", "speed_limit=30", "encounters.host_speed.step=2", "merging.ahead=any")
    made = damaged(rng.choice(good).encode(), rng).decode(errors="replace").replace("\0", "")
    return ("run", "designed-2", *CASE, "--method", "acc", "--json", f"--set={made}")


def _vary(folder: Path, rng: random.Random) -> tuple[str, ...]:
    (folder / "s.toml").write_text(GRID)
    good = ("acc.headway=1:2:0.5", "test.horizon=1,2,5", "acc.headway=1.0,2.0", "merging.ahead=any,clear")
    made = damaged(rng.choice(good).encode(), rng).decode(errors="replace").replace("\0", "")
    return ("sweep", "s.toml", "--method", "acc", "--world", "closed-form", "--jobs", "1", f"--vary={made}", "--json")


def _plugin(folder: Path, rng: random.Random) -> tuple[str, ...]:
    (folder / "p.py").write_bytes(damaged(PLUGIN.encode(), rng))
    return ("run", "designed-2", *CASE, "--method", "mine", "--plugin", "p.py", "--json")


TARGETS = [
    Target("ngsim-text", _trajectory_file("t.txt", trajectories("  ", False))),
    Target("ngsim-csv", _trajectory_file("t.csv", trajectories(",", True))),
    Target("portal-csv", _trajectory_file("p.csv", trajectories(",", True, True))),
    Target("parquet", _parquet),
    Target("scenario", _scenario),
    Target("ramp-toml", _ramp("ramp.toml")),
    Target("routes", _ramp("my.rou.xml")),
    Target("sumocfg", _ramp("my.sumocfg")),
    Target("net", _ramp("designed.net.xml")),
    Target("plain-xml", _ramp("designed.edg.xml")),
    Target("netccfg", _ramp("designed.netccfg")),
    Target("model", _model),
    Target("set", _words),
    Target("vary", _vary),
    Target("plugin", _plugin),
]

"""Good inputs of the kinds that the command reads, and how they are damaged."""

from __future__ import annotations

import io
import random
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import csv

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


def damaged(content: bytes, rng: random.Random) -> bytes:
    """A text or other bytes with one to three changes."""
    for _ in range(rng.randint(1, 3)):
        content = rng.choice(_CHANGES)(content, rng)
    return content


def changed_bytes(content: bytes, rng: random.Random) -> bytes:
    """Some bytes taken out, doubled or replaced."""
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


def _digit(content: bytes, rng: random.Random) -> bytes:
    digits = [at for at, byte in enumerate(content) if byte in b"0123456789"]
    if not digits:
        return content
    at = rng.choice(digits)
    return content[:at] + rng.choice(b"0123456789-.").to_bytes() + content[at + 1 :]


_CHANGES = (_word, _word, _word, _digit, _digit, _digit, _lines, changed_bytes, _cut)


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


def episode_table() -> pa.Table:
    """One merging episode: a merging car and a car behind it."""
    frames = [frame for _ in (0, 1) for frame in range(30)]
    cars = [car for car in (0, 1) for _ in range(30)]
    stations = [10.0 * (not car) + 1.5 * frame for car, frame in zip(cars, frames, strict=True)]
    return pa.table(
        {"episode": [50] * 60, "frame": frames, "car": cars, "station_m": stations, "speed_m_s": [15.0] * 60}
    )


def trajectory_table() -> pa.Table:
    """The two cars of `trajectories` as a table."""
    content = io.BytesIO(trajectories(",", True, True))
    return csv.read_csv(content, csv.ReadOptions(use_threads=False))


def damaged_parquet(table: pa.Table, rng: random.Random) -> bytes:
    """A table with one or two other columns, perhaps cut, perhaps with other bytes in its file."""
    n = table.num_rows
    for _ in range(rng.randint(1, 2)):
        at = rng.randrange(table.num_columns)
        column = table.column_names[at]
        change = rng.randrange(4)
        if change == 0 and table.num_columns > 1:
            table = table.remove_column(at)
        elif change == 1:
            table = table.append_column(rng.choice((column, column.upper())), table.column(at))
        else:
            table = table.set_column(at, column, rng.choice(_COLUMNS)(n, rng))
    file = io.BytesIO()
    pq.write_table(table.slice(0, rng.choice((0, 1, n, n))), file)
    return changed_bytes(file.getvalue(), rng) if rng.random() < 0.3 else file.getvalue()


_COLUMNS = (
    lambda n, rng: pa.array([[1.0]] * n),
    lambda n, rng: pa.array([None] * n),
    lambda n, rng: pa.array(["x"] * n),
    lambda n, rng: pa.array(["1"] * n),
    lambda n, rng: pa.array([{"a": 1}] * n),
    lambda n, rng: pa.array(np.full(n, rng.choice((np.nan, np.inf, -1.0, 1e300)))),
    lambda n, rng: pa.array([b"\xff"] * n),
    lambda n, rng: pa.array([True] * n),
    lambda n, rng: pa.array(rng.choices(range(-5, 5000), k=n)),
)

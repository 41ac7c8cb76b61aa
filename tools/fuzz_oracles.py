"""Second readings, by simple code of their own: what the package has taken from a file must be what stands in it."""

from __future__ import annotations

import csv
import json
import math
import random
import re
import tomllib
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
from lxml import etree
from pydantic import BaseModel

from merge_cosim.api.results import Results
from merge_cosim.core.encounter import Encounters
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.ngsim.formats import TEXT_COLUMNS
from merge_cosim.ngsim.pairing.tracks import Tracks
from merge_cosim.ngsim.read import Reading
from merge_cosim.ramps.ramp import Ramp, Section
from merge_cosim.sweeps.task import Task

FOOT_M = 0.3048

FIELDS = ("Vehicle_ID", "Frame_ID", "Global_Time", "Local_X", "Local_Y", "v_Vel", "Lane_ID")


class Wrong(AssertionError):
    """A file was taken, but not as it stands."""


def same(what: str, taken: object, stands: object) -> None:
    """Refuse a difference between what was taken and what stands in the file."""
    if taken != stands:
        raise Wrong(f"{what}: taken as {str(taken)[:300]}, but it is {str(stands)[:300]}")


def trajectories(reading: Reading, rows: Iterable[dict[str, str]]) -> None:
    """Compare a reading with the rows of the file, as texts by the columns' names."""
    stands: dict[tuple[int, ...], tuple[float, ...]] = {}
    every = set()
    rows = list(rows)
    count, clock = len(rows), dict[int, int]()
    for origin in sorted(
        set() if reading.elsewhere else set(map(_origin, rows))
    ):  # origins up to a minute apart are one recording
        near = [start for start in clock.values() if 0 <= origin - start <= 60_000]
        clock[origin] = max(near, default=origin)
    for row in rows:
        try:
            vehicle, frame, _, x, y, speed, lane = (_number(row[name]) for name in FIELDS)
        except Wrong:
            if reading.elsewhere:  # only rows of known sites are taken
                continue
            raise
        values = (x * FOOT_M, y * FOOT_M, speed * FOOT_M, lane)
        stands.setdefault((0 if reading.elsewhere else clock[_origin(row)], int(vehicle), int(frame)), values)
        every.add((int(vehicle), int(frame), *(round(value, 3) for value in values)))
    same("rows", reading.rows, count)
    tables = [table.to_pydict() for table in reading.tables.values()]
    taken = sorted(
        (vehicle, frame, *(round(float(value), 3) for value in values))
        for table in tables
        for vehicle, frame, *values in zip(
            *(table[name] for name in ("vehicle_id", "frame", "x", "y", "speed", "lane")), strict=True
        )
    )
    if reading.elsewhere:  # rows of other places are passed over, which only their number tells
        same("rows of all sites", len(taken) + reading.repeats.dropped + sum(reading.elsewhere.values()), count)
        if strangers := set(taken) - every:
            raise Wrong(f"no row of the file is {strangers.pop()}")
        return
    near_enough(taken, sorted((*key[1:], *(round(value, 3) for value in values)) for key, values in stands.items()))


def near_enough(taken: list[tuple[float, ...]], stands: list[tuple[float, ...]]) -> None:
    """Compare rows of numbers, up to the rounding of 32-bit numbers."""
    same("number of rows", len(taken), len(stands))
    if taken and not np.allclose(np.array(taken), np.array(stands), atol=2e-3, rtol=1e-6):
        at = int(np.argmax(~np.isclose(np.array(taken), np.array(stands), atol=2e-3, rtol=1e-6).all(axis=1)))
        raise Wrong(f"row {taken[at]} stands as {stands[at]}")


def _origin(row: dict[str, str]) -> int:
    return int(_number(row["Global_Time"]) - 100 * int(_number(row["Frame_ID"])))


def _number(text: str) -> float:
    """A number as it may stand in a file: thousands set apart by commas, blanks around it."""
    text = text.strip()
    if "," in text and not re.fullmatch(r"-?\d{1,3}(,\d{3})+(\.\d*)?", text):
        raise Wrong(f"{text!r} was taken as a number")
    try:
        value = float(text.replace(",", ""))
    except ValueError:
        raise Wrong(f"{text!r} was taken as a number") from None
    if not math.isfinite(value):
        raise Wrong(f"{text!r} was taken as a number")
    return value


def text_rows(content: bytes, names: tuple[str, ...] | None) -> Iterator[dict[str, str]]:
    """The rows of a text; `names` of the columns where it has no header, and then blanks separate them, or commas.

    A text that has lost its header has NGSIM's columns.
    """
    lines = content.decode("utf-8-sig", errors="replace").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    comma = "," in lines[0]
    parted = csv.reader(lines) if comma else (re.findall(r"[^ \t\v\f]+", line) for line in lines)
    parted = (fields for fields in parted if fields)
    first = next(parted)
    if names is None and all(re.fullmatch(r"-?\d+(\.\d*)?", field.strip()) for field in first):
        names = TEXT_COLUMNS
    header = [name.strip().lower() for name in names or first]
    for fields in chain([first] if names else [], parted):
        same("columns of a row", len(fields), len(header))
        cells = dict(zip(header, fields, strict=True))
        yield {name: cells[name.lower()] for name in FIELDS}


def parquet_rows(file: Path) -> Iterator[dict[str, str]]:
    """The rows of a Parquet file, as texts."""
    held = pq.ParquetFile(file)
    table = held.read([name for name in held.schema_arrow.names if name.lower() in map(str.lower, FIELDS)])
    columns = {name.lower(): table.column(at).to_pylist() for at, name in enumerate(table.column_names)}
    for values in zip(*(columns[name.lower()] for name in FIELDS), strict=True):
        yield dict(zip(FIELDS, map(str, values), strict=True))


def episodes(tracks: Tracks, file: Path) -> None:
    """Compare tracks with the file that they were read from: cars, frames and speeds."""
    names = ["episode", "frame", "car", "station_m", "speed_m_s"]
    frame = pd.read_parquet(file)[names].astype(float).sort_values(["episode", "car", "frame"], kind="stable")
    if not np.isfinite(frame.to_numpy()).all():
        raise Wrong("a number is missing")
    frame = frame[frame["episode"] >= 0]
    same("speeds", tracks.speed.tolist(), frame["speed_m_s"].tolist())
    same("cars", len(tracks.vehicle), len(frame.groupby(["episode", "car"])))
    for (_, _), rows in frame.groupby(["episode", "car"]):
        same("frames in a row", set(np.diff(rows["frame"])) <= {1.0}, True)


def leaves(document: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """All values of a nested document with their places."""
    if isinstance(document, dict | list | tuple):
        items = document.items() if isinstance(document, dict) else enumerate(document)
        for key, value in items:
            yield from leaves(value, (*path, str(key)))
    else:
        yield path, document


def same_leaves(taken: Any, document: Any) -> None:
    """Every value of a document must be among what was taken: the same number, not a near one, and not nothing."""
    found = dict(leaves(taken))
    for path, value in leaves(document):
        name, other = ".".join(path), found.get(path, Wrong)
        if isinstance(value, float) and not math.isfinite(value):
            raise Wrong(f"{name}: {value} was taken as {other}")
        if isinstance(value, bool) or isinstance(other, bool) or not isinstance(value, int | float):
            same(name, (type(other), str(other)), (type(value), str(value)))
        else:
            same(name, float(other), float(value)) if isinstance(other, int | float) else same(name, other, value)


def same_toml(taken: BaseModel, file: Path) -> None:
    """The same for a TOML file and what was made of it."""
    same_leaves(taken.model_dump(by_alias=True), tomllib.loads(file.read_text()))


def grid(encounters: Encounters, file: Path) -> None:
    """Count the encounters of a grid."""
    table = tomllib.loads(file.read_text())["encounters"]
    count = 1
    for name in ("host_offset", "host_speed", "merging_speed"):
        axis = {key: Fraction(str(value)) for key, value in table.get(name, {}).items()}
        if len(axis) < 3:
            return  # the default
        count *= math.floor((axis["to"] - axis["from"]) / axis["step"]) + 1
    same("encounters", len(encounters), count)


def ramp(found: Ramp, net: Path, definition: Path) -> None:
    """Compare a ramp with its two files: the edges' lengths, one after the other, from the gore."""
    content = tomllib.loads(definition.read_text())
    same("speed limit", found.speed_limit, content["speed_limit"])
    same("merging point", found.merging_point, content["merging_point"])
    edges = {edge.get("id"): edge.findall("lane") for edge in etree.parse(net).getroot().iter("edge")}
    for key, lanes, sections in (("main", "host_lane", found.main), ("ramp", "merging_lane", found.ramp)):
        same(f"edges of {key}", [one.edge for one in sections], content[key])
        same(f"lanes of {key}", [one.lane for one in sections], content[lanes])
        _lengths(sections, edges)
    own = content["main"][: content["main"].index(content["gore"])]
    same("gore", round(found.main[0].start, 6), -round(sum(float(edges[one][0].get("length")) for one in own), 6))


def _lengths(sections: tuple[Section, ...], edges: dict[str | None, list[etree._Element]]) -> None:
    for one in sections:
        own = edges[one.edge]
        length = float(own[0].get("length", "nan"))
        if not (math.isfinite(length) and length > 0):
            raise Wrong(f"edge {one.edge} has the length {length}")
        same(f"length of {one.edge}", one.length, length)
        same(f"lane {one.lane} of {one.edge} is there", one.lane < len(own), True)
    for before, after in pairwise(sections):
        same(f"start of {after.edge}", round(after.start, 6), round(before.start + before.length, 6))


def routes(encounters: Encounters, file: Path, found: Ramp) -> None:
    """Compare encounters with the route file: the cars with a role, in order, and where they start."""
    root = etree.parse(file).getroot()
    types = {kind.get("id"): kind for kind in root.iter("vType")}
    cars: dict[str, list[tuple[str, float, float]]] = {"host": [], "merging": []}
    for vehicle in root.iter("vehicle"):
        kind = types.get(vehicle.get("type", ""))
        content = {
            p.get("key"): p.get("value") for part in (kind, vehicle) if part is not None for p in part.iter("param")
        }
        if "merge-cosim.role" in content:
            own = vehicle.find("route")
            named = [one for one in root.iter("route") if one.get("id") == vehicle.get("route")]
            edge = (own if own is not None else named[-1]).get("edges", "").split()[0]
            section = next(one for one in (*found.main, *found.ramp) if one.edge == edge)
            position = float(vehicle.get("departPos", "nan"))
            x = section.start + position + (section.length if position < 0 else 0.0)
            cars[str(content["merge-cosim.role"])].append(
                (vehicle.get("id", ""), round(x, 6), float(vehicle.get("departSpeed", "nan")))
            )
    pairs = list(zip(cars["host"], cars["merging"], strict=True))
    same("names", encounters.case.tolist(), [f"{host[0]}_{merging[0]}" for host, merging in pairs])
    for role, at in (("host", 0), ("merging", 1)):
        x = getattr(encounters, f"{role}_station") + encounters.merge_position
        same(f"x of {role}", np.round(x, 6).tolist(), [pair[at][1] for pair in pairs])
        same(f"speed of {role}", getattr(encounters, f"{role}_speed").tolist(), [pair[at][2] for pair in pairs])


def model(found: IntentionModel, file: Path) -> None:
    """Compare a model with its file."""
    document = json.loads(file.read_text())
    both = ("YIELD", "NOT_YIELD")
    same("pairs", found.pairs.tolist(), [document["pairs"][name] for name in both])
    same("merge_speed", found.merge_speed, document["merge_speed"])
    same("trained_on", list(found.trained_on), document["trained_on"])
    same("name", found.name, document["name"])
    for lag, speed in found.speeds.items():
        for code, name in enumerate(both):
            entries = document["transitions"][str(lag)][name]
            same(f"transitions {lag} {name}", int(speed.histogram.counts[code].sum()), sum(one[2] for one in entries))
        for density in (speed.gaussian, speed.mixture):
            for name, value in vars(density).items():
                if isinstance(value, np.ndarray) and not np.isfinite(value.astype(float)).all():
                    raise Wrong(f"{name} of lag {lag} is not finite")
    for code, name in enumerate(both):
        entries = {tuple(one[:2]): one[2] for one in document["arrivals"][name]}
        if not math.isclose(found.arrivals.shares[code].sum(), sum(entries.values()), rel_tol=1e-9):
            raise Wrong(f"arrivals {name}")
    if not math.isfinite(found.merge_speed) or found.merge_speed <= 0:
        raise Wrong(f"merge_speed {found.merge_speed}")


def value_of(text: str) -> Any:
    """A value of the command line: a number, true or false, or a text."""
    text = text.strip()
    if re.fullmatch(r"[-+]?(0|[1-9](_?\d)*)|0x[0-9a-fA-F]+", text):
        return int(text, 0)
    if re.fullmatch(r"[-+]?(0|[1-9](_?\d)*)(\.\d(_?\d)*)?([eE][-+]?\d(_?\d)*)?", text):
        return float(text)
    return {"true": True, "false": False}.get(text, text)


def steps(text: str) -> list[Any] | None:
    """The values of `A:B:STEP` or `X,Y,Z`; None where it holds more than plain values."""
    parts = text.strip().split(":")
    if len(parts) == 3:
        first, last, step = (Fraction(part.strip()) for part in parts)
        count = math.floor((last - first) / step) + 1
        return [float(first + i * step) for i in range(count)]
    if set(text) & set("[{\"'#"):
        return None
    return [value_of(part) for part in text.split(",")]


def settings(tasks: list[Task], text: str, vary: bool) -> None:
    """Compare the tasks of a plan with the text of a setting or a variation."""
    name, _, written = text.partition("=")
    stands = steps(written) if vary else None if set(written) & set("[{\"'#") else [value_of(written)]
    if stands is None:
        return
    taken = {_value(task, name.strip()) for task in tasks if task.variation or not vary}
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in stands)
    if numbers:
        same(text, sorted({round(float(value), 9) for value in taken}), sorted({round(float(v), 9) for v in stands}))
    else:
        same(text, sorted(map(str, taken)), sorted(map(str, set(stands))))


def _value(task: Task, name: str) -> Any:
    if name in (parameters := task.method.parameters()):
        return parameters[name]
    value = task.scenario.model_dump(by_alias=True)
    for part in name.split("."):
        value = value[part]
    return value


def results(taken: tuple[pd.DataFrame, pd.DataFrame, Any], whole: Results, summary: Path) -> None:
    """What was taken from a damaged folder must be what the whole one holds."""
    same("rows", taken[0].equals(whole.rows), True)
    same("traces", taken[1].equals(whole.traces), True)
    same("summary", taken[2], json.loads(summary.read_text()))


CONDITIONS = (
    "failed",
    "stuck",
    "delay_s > {:.1f}",
    "host_speed_0 >= {:.0f}",
    "method == 'acc'",
    "case != 'x'",
    "n == 0",
)


def condition(rng: random.Random) -> str:
    """A condition on the columns of results."""
    parts = [rng.choice(CONDITIONS).format(rng.uniform(0, 20)) for _ in range(rng.randint(1, 3))]
    parts = [f"not {part}" if rng.random() < 0.2 else part for part in parts]
    text = parts[0]
    for part in parts[1:]:
        text = f"({text}) {rng.choice(('and', 'or', '&', '|'))} ({part})"
    return text


def where(rows: list[dict[str, Any]], condition: str, taken: list[str]) -> None:
    """Compare the rows for which a condition holds with Python's own reading of it, row by row."""
    try:
        code = compile(
            condition.strip().replace("&", " and ").replace("|", " or ").replace("~", " not "), "where", "eval"
        )
        names = {"__builtins__": {}, "inf": math.inf, "Inf": math.inf}
        holds = [row["case"] + row["method"] for row in rows if eval(code, names, row)]  # a condition that was taken
    except Exception as error:
        raise Wrong(f"{condition!r} was taken, but Python says {error!r}") from None
    same(condition, taken, holds)

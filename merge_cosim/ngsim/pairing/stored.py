"""Pairs as one Parquet file: a row per encounter, the logs as lists, what was rejected in the file's metadata."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from merge_cosim.core.encounter import Encounters, Ragged, ReplayLog
from merge_cosim.ngsim.pairing.pairs import Paired

_FACTS = b"merge_cosim"
_COLUMNS = tuple(field.name for field in fields(Encounters) if field.name != "log")
_TRACKS = ("merging_station", "merging_speed", "host_station", "host_speed")
_CYCLES = ("change_cycle", "score_until")


def write_pairs(paired: Paired, path: Path) -> None:
    """Write `paired` to `path`."""
    log = paired.encounters.log
    if log is None:
        raise ValueError("these encounters have no log")
    columns = {name: pa.array(getattr(paired.encounters, name)) for name in _COLUMNS}
    columns |= {name: pa.array(getattr(log, name)) for name in _CYCLES}
    for name in _TRACKS:
        track = getattr(log, name)
        columns[f"log.{name}"] = pa.LargeListArray.from_arrays(track.offsets, track.values)
    facts = {"merging_cars": paired.merging_cars, "rejected": dict(paired.rejected)}
    table = pa.table(columns).replace_schema_metadata({_FACTS: json.dumps(facts).encode()})
    pq.write_table(table, path)


def read_pairs(path: Path) -> Paired:
    """Read what `write_pairs` wrote."""
    table = pq.read_table(path)
    facts = json.loads(table.schema.metadata[_FACTS])
    lists = {name: table[f"log.{name}"].combine_chunks() for name in _TRACKS}
    log: dict[str, Any] = {
        name: Ragged(each.flatten().to_numpy(), each.offsets.to_numpy()) for name, each in lists.items()
    }
    log |= {name: table[name].to_numpy() for name in _CYCLES}
    return Paired(
        Encounters(**{name: table[name].to_numpy() for name in _COLUMNS}, log=ReplayLog(**log)),
        facts["merging_cars"],
        {reason: tuple(names) for reason, names in facts["rejected"].items()},
    )

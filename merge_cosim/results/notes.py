"""Notes on the results of a finished sweep, one line each."""

from __future__ import annotations

from typing import Any

from merge_cosim.results.files import csv_rows, readable
from merge_cosim.results.invariants import lines
from merge_cosim.results.store import NOTES_CSV, SUMMARY_CSV, ResultFolder


def note_lines(folder: ResultFolder) -> list[str]:
    """A line for each broken invariant, event in scenes, and model that was not trained where cases begin."""
    return [*lines(folder.invariants()), *_scene_notes(folder), *_support_notes(folder)]


def _support_notes(folder: ResultFolder) -> list[str]:
    """How many cases begin where a model was not trained, a line per scenario, variation and model."""
    found: dict[tuple[str, ...], tuple[int, int]] = {}
    with readable(folder.path / SUMMARY_CSV):
        for row in csv_rows(folder.path / SUMMARY_CSV):
            outside = row.get("outside_support")
            if outside and float(outside):
                key = tuple(row[name] for name in ("scenario", "variation", "site", "source", "model"))
                found[key] = int(float(outside)), int(row["n"]) + int(row["censored"])
    return [
        f"model {key[-1]}: {outside:,} of {n:,} cases of {' '.join(filter(None, key[:2]))} begin at times to "
        f"arrival that it was not trained on (column in_support)"
        for key, (outside, n) in found.items()
    ]


def _scene_notes(folder: ResultFolder) -> list[str]:
    events: dict[str, list[dict[str, Any]]] = {}
    for row in csv_rows(folder.path / NOTES_CSV):
        events.setdefault(row["event"], []).append(row)
    return [
        f"{event.replace('_', ' ')}: {len(rows):,}, such as: {rows[0]['what']} ({rows[0]['scenario']}, "
        f"{rows[0]['method']}, scene {rows[0]['scene']}); all in {folder.path / NOTES_CSV}"
        for event, rows in events.items()
    ]

"""Logged positions by which the drawing is corrected and judged."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

JUMPY = 1380.0
"""Local_Y [ft] beyond which lane 8 of US-101 is left out: there, positions jump sideways by metres and back."""


def positions(data: Path, site: str) -> pd.DataFrame:
    """Rows with segment, Vehicle_ID, Lane_ID, Local_X, Local_Y [ft] of a site's fragments."""
    columns = ["segment", "Vehicle_ID", "Lane_ID", "Local_X", "Local_Y"]
    rows = pd.read_parquet(data / f"{site}.parquet", columns=columns)
    if site == "us101":
        return rows[(rows["Lane_ID"] != 8) | (rows["Local_Y"] < JUMPY)]
    return rows

"""What on a page depends on the cars that a model was trained on: the same sweep under models of other thirds."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import pandas as pd
from blocks import swept

from merge_cosim.results.statistics.ensemble import RANK, rivals
from merge_cosim.studies.training import train_ensemble

MODELS = 10


def under_models(words: Sequence[str], data: Path | None, folder: Path | None = None) -> pd.DataFrame | None:
    """Summary of `merge-cosim sweep` with these words under models that are each trained on another third of the cars.

    None with neither data nor folder.

    Args:
        words: Words of the command, without its model and its folder.
        data: Folder with real NGSIM files.
        folder: Its result folder, if it was run already.
    """
    if folder is None:
        if data is None:
            return None
        models = Path(tempfile.mkdtemp(prefix="models-"))
        train_ensemble("us101", data, "ngsim", 0, models, splits=MODELS)
        folder = swept([*words, "--model", str(models)])
    return pd.read_json(folder / "summary.json")


def what_flips(summary: pd.DataFrame, row: str, base: str | None = None) -> str:
    """Which orders of two methods by failed or stuck, and which changes from a row, not all models agree on.

    Args:
        summary: Summary of a sweep under several models.
        row: Column whose values are the rows of the page's table.
        base: The row that the others are compared with; None for no comparison.
    """
    models, rows = summary["model"].replace("", pd.NA).nunique(), summary[row].nunique()
    pairs = rivals(summary)
    flips = pairs[(pairs["first_better"] > 0) & (pairs["second_better"] > 0)]
    found = []
    for (first, second), part in flips.groupby(["first", "second"]):
        counts = " to ".join(map(str, sorted({part["first_better"].min(), part["first_better"].max()})))
        found.append(f"{first} before {second} under {counts} of them" + f" in {len(part)} of {rows} rows" * (rows > 1))
    text = f"Under {models} models, each trained on another third of the real cars, "
    if found:
        text += f"these orders by failed or stuck are not the same: {'; '.join(found)}. No other order of two methods "
        text += "depends on the model. "
    else:
        text += "the order of no two methods by failed or stuck depends on the model. "
    if base is not None:
        for method, part in summary[summary["model"] != ""].groupby("method"):
            rates = part.pivot(index=row, columns="model", values=RANK)
            worse = (rates.sub(rates.loc[base]) > 0).sum(axis=1).drop(base)
            mixed = [f"`{name}` ({count})" for name, count in worse.items() if 0 < count < models]
            first = f"`{base}`" if base else "no error"
            if mixed:
                text += f"Whether {method} does worse than with {first} depends on it for {', '.join(mixed)} (models "
                text += "under which it does). "
    return text.rstrip()


def paragraph(text: str) -> str:
    """Text in the lines of a page."""
    return fill(text, 120, break_on_hyphens=False, break_long_words=False) + "\n"

"""What all figures share: size and type."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from merge_cosim.core import colors
from merge_cosim.report.methods import broken

WIDTH, HEIGHT = 5.4, 3.4
"""Size of a single panel [in]: half a page's width on a desk, all of it on a phone."""
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": "medium",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": colors.FAINT,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": "small",
    "pdf.fonttype": 42,
    "lines.linewidth": 1.6,
    "svg.hashsalt": "merge-cosim",
}


@dataclass(frozen=True)
class Paper:
    """What figures are made for.

    Attributes:
        width: Width of every figure [in]; None for each figure's own.
        font: Size of the type [pt].
    """

    width: float | None = None
    font: float = 9.0


DESK = Paper()
_PAPER: ContextVar[Paper] = ContextVar("paper", default=DESK)
LEAST_CELL = 1.1
"""Least width of a small panel [in]."""


@contextmanager
def made_for(paper: Paper) -> Iterator[None]:
    """Context in which every figure has a paper's width and type."""
    token = _PAPER.set(paper)
    try:
        yield
    finally:
        _PAPER.reset(token)


def style() -> Any:
    """Context in which a figure is made."""
    return mpl.rc_context({**STYLE, "font.size": _PAPER.get().font})


def panel(height: float = HEIGHT) -> tuple[Figure, Any]:
    """Make a figure with one set of axes."""
    width = _PAPER.get().width or WIDTH
    figure = Figure(figsize=(width, height * max(width / WIDTH, 0.7)), layout="constrained")
    return figure, figure.add_subplot()


def grid_of(
    count: int, across: int, cell: tuple[float, float], sharex: bool = True, titles: Sequence[str] = ()
) -> tuple[Figure, list[Any]]:
    """Make small multiples that share their axes; returns the figure and `count` axes, row by row.

    Args:
        count: Number of small panels.
        across: Most panels in a row.
        cell: Width and height of one [in].
        sharex: They share the horizontal axis as well as the vertical one.
        titles: Their titles, which may take several lines; the figure is made high enough.
    """
    across = min(across, count)
    wanted = _PAPER.get().width
    if wanted is not None:
        across = min(across, max(1, int(wanted / LEAST_CELL)))
        cell = wanted / across, cell[1] * min(wanted / across / cell[0], 1.5)
    down = -(-count // across)
    lines = max((broken(title).count("\n") for title in titles), default=0)
    cell = cell[0], cell[1] + lines * 1.3 * mpl.rcParams["font.size"] / 72
    figure = Figure(figsize=(cell[0] * across, cell[1] * down), layout="constrained")
    axes = figure.subplots(down, across, sharex=sharex, sharey=True, squeeze=False).ravel().tolist()
    for spare in axes[count:]:
        spare.remove()
    for above in axes[max(count - across, 0) : count]:
        above.tick_params(labelbottom=True)
    return figure, axes[:count]


def legend_below(figure: Figure, handles: Sequence[Any], labels: Sequence[str], **options: Any) -> None:
    """Put a legend below the axes, in as many columns as fit, and make the figure higher by it."""
    font = mpl.rcParams["font.size"]
    longest = max((len(line) for label in labels for line in label.split("\n")), default=1)
    columns = max(1, min(4, int(figure.get_figwidth() / (0.0088 * font * longest + 0.055 * font))))
    rows = sum(label.count("\n") + 1 for label in labels) / columns
    figure.set_figheight(figure.get_figheight() + max(rows - 2, 0) * 1.3 * font / 72)
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, **options)

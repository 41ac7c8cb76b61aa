"""Figures of one case in detail: where the cars are, how fast, and what the estimators believe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from merge_cosim.core import colors
from merge_cosim.report import canvas
from merge_cosim.report.methods import Look, in_order

SAME_PATH = 1e-6
"""Paths that differ by no more than this [m] are drawn once."""
MOST_LOG_ODDS = 12.0
"""Log-odds beyond this are drawn at the edge: P is 1 to within 1e-5 there."""
MARGIN_S = 1.0
"""Time drawn after the last host that arrived was scored [s]."""
MARK_EVERY = 0.12
"""A method's shape stands on its line at this distance, as a share of the figure's diagonal."""
NAMES_IN_LABEL = 3
DASHES = (0, (5, 2.5))
"""Line style of merging cars."""


@dataclass(frozen=True)
class _Path:
    """A path that several methods drove.

    Attributes:
        methods: Those methods.
        trace: The record of the first.
        failed: The case failed under them.
    """

    methods: list[str]
    trace: pd.DataFrame
    failed: bool

    @property
    def label(self) -> str:
        lines = [self.methods[i : i + NAMES_IN_LABEL] for i in range(0, len(self.methods), NAMES_IN_LABEL)]
        return ",\n".join(", ".join(line) for line in lines) + (" ×" if self.failed else "")


def path_figures(traces: pd.DataFrame, failed: Mapping[str, bool], looks: Mapping[str, Look]) -> tuple[Figure, Figure]:
    """Station and speed over time, as Fig. 6 of Dong, Dolan, Litkouhi 2017.

    Args:
        traces: Cycle-by-cycle records of one case under all methods.
        failed: For each method, whether the case failed.
        looks: How the methods are drawn.

    Returns:
        Figure of the stations and figure of the speeds. Methods whose cars drove the same path share one line.
    """
    paths = _paths(traces, failed)
    return (
        _draw(paths, looks, "station_m", "station from the merging point [m]"),
        _draw(paths, looks, "speed_m_s", "speed [m/s]"),
    )


def log_odds_figure(traces: pd.DataFrame, looks: Mapping[str, Look]) -> Figure | None:
    """Log-odds of not yielding until a car reaches the merging point; None if every estimator is a plain rule."""
    with canvas.style():
        figure, axes = canvas.panel()
        drawn = False
        for method in in_order(traces["method"]):
            trace = traces[(traces["method"] == method)]
            trace = trace[(trace["host_station_m"] < 0) & (trace["merging_station_m"] < 0)]
            odds = trace["log_odds"].to_numpy(dtype=float)
            if not np.isfinite(odds).any():
                continue
            drawn = True
            odds = np.clip(odds, -MOST_LOG_ODDS, MOST_LOG_ODDS)
            axes.plot(trace["time_s"], odds, label=method, **_line(looks[method]))
        if not drawn:
            return None
        axes.axhline(0.0, color=colors.GREY, lw=0.8, ls=(0, (2, 2)))
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, -1.0), max(high, 1.0))
        axes.set(xlabel="time [s]", ylabel="log-odds of not yielding\n(< 0: the host goes first)")
        _legend(figure)
    return figure


def _draw(paths: list[_Path], looks: Mapping[str, Look], quantity: str, label: str) -> Figure:
    with canvas.style():
        figure, axes = canvas.panel()
        end = _last_time(paths)
        shared = _same_merging_car(paths)
        for path in paths:
            look, trace = looks[path.methods[0]], path.trace[path.trace["time_s"] <= end]
            axes.plot(trace["time_s"], trace[f"host_{quantity}"], label=path.label, **_line(look))
            if shared is None:
                axes.plot(trace["time_s"], trace[f"merging_{quantity}"], color=look.color, lw=0.9, ls=DASHES)
            if path.failed:
                last = trace.iloc[-1]
                axes.plot(last["time_s"], last[f"host_{quantity}"], "x", color=look.color, ms=9, mew=2.2, zorder=5)
        if shared is not None:
            trace = shared[shared["time_s"] <= end]
            axes.plot(trace["time_s"], trace[f"merging_{quantity}"], color=colors.INK, lw=1.3, ls=DASHES)
        axes.plot([], [], color=colors.INK, lw=1.1, ls=DASHES, label="merging car")
        if quantity == "station_m":
            axes.axhline(0.0, color=colors.GREY, lw=0.8, ls=(0, (2, 2)))
        axes.set(xlabel="time [s]", ylabel=label)
        axes.set_xlim(0.0, end * 1.02)
        _legend(figure)
    return figure


def _line(look: Look) -> dict[str, Any]:
    return {"color": look.color, "ls": look.line, "marker": look.mark, "markevery": MARK_EVERY, "ms": 4}


def _legend(figure: Figure) -> None:
    canvas.legend_below(figure, *figure.axes[0].get_legend_handles_labels(), handlelength=1.8, columnspacing=1.2)


def _paths(traces: pd.DataFrame, failed: Mapping[str, bool]) -> list[_Path]:
    found: list[_Path] = []
    for method in in_order(traces["method"]):
        trace = traces[traces["method"] == method].reset_index(drop=True)
        alike = [path for path in found if path.failed == failed[method] and _alike(path.trace, trace)]
        if alike:
            alike[0].methods.append(method)
        else:
            found.append(_Path([method], trace, failed[method]))
    return found


def _alike(one: pd.DataFrame, other: pd.DataFrame) -> bool:
    columns = ["host_station_m", "merging_station_m"]
    return len(one) == len(other) and bool((one[columns] - other[columns]).abs().to_numpy().max() <= SAME_PATH)


def _same_merging_car(paths: list[_Path]) -> pd.DataFrame | None:
    """The longest record of the merging car, if it drove the same path under all methods."""
    longest = max((path.trace for path in paths), key=len)
    for path in paths:
        stations = path.trace["merging_station_m"].to_numpy(dtype=float)
        if np.abs(stations - longest["merging_station_m"].to_numpy(dtype=float)[: len(stations)]).max() > SAME_PATH:
            return None
    return longest


def _last_time(paths: list[_Path]) -> float:
    """End of the figure [s]: when the last host that reaches the merging point was scored."""
    arrived = [path.trace["time_s"].max() for path in paths if path.trace["host_station_m"].max() >= 0.0]
    longest = max(path.trace["time_s"].max() for path in paths)
    return float(min(max(arrived) + MARGIN_S, longest) if arrived else longest)

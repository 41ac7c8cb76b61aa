"""Figures over all cases of a scenario: failure maps of grids, delay against ambiguity, varied parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from merge_cosim.core import colors
from merge_cosim.core.units import FloatArray
from merge_cosim.report import canvas
from merge_cosim.report.failure_shares import failure_shares
from merge_cosim.report.methods import Look, broken, in_order
from merge_cosim.results.statistics.summary import ALL_SITES, AMBIGUITY_EDGES

CELL, ALONE = (1.8, 1.9), (4.2, 3.4)
"""Size of one small panel [in], and of the only one."""
SHOWN = 0.95
"""Share of the cases inside the axes, of those in which the host arrived; the rest is drawn at the edges."""
LEAST_RANGE = 1.0
"""Smallest range of the delays [s]."""
LEAST_TOP = 1.0
"""Smallest upper end of an axis of failures [%]."""
MOST_NUMBERS = 24
"""Most bars that carry their number."""


def failure_map(results: pd.DataFrame) -> Figure:
    """Share of failed cases of one scenario by both initial speeds, a map per method; without a case it stays blank.

    A dot marks speeds at which a host did not reach the merging point in time in at least one case.
    """
    shares = failure_shares(results)
    parts = {
        method: np.divide(failed, shares.n[method], out=np.full(failed.shape, np.nan), where=shares.n[method] > 0)
        for method, failed in shares.failed.items()
    }
    top = max(max(float(np.nanmax(part)) for part in parts.values()), 1e-3)
    edges = _edges(shares.mergings), _edges(shares.hosts)
    with canvas.style():
        figure, axes = canvas.grid_of(len(parts), 4, CELL if len(parts) > 1 else ALONE, titles=list(parts))
        for ax, (method, part) in zip(axes, parts.items(), strict=True):
            image = ax.pcolormesh(*edges, 100 * part, vmin=0, vmax=100 * top, cmap="YlOrRd", linewidth=0)
            row, column = np.nonzero(shares.absent[method])
            ax.scatter(shares.mergings[column], shares.hosts[row], s=1.2, color=colors.INK, linewidths=0)
            ax.set_title(broken(method))
            ax.grid(False)
            ax.set_aspect("auto")
        figure.supxlabel("merging car's initial speed [m/s]", fontsize="medium")
        figure.supylabel("host's initial speed [m/s]", fontsize="medium")
        figure.colorbar(image, ax=axes, label="failed cases [%]", shrink=0.9 if len(parts) > 4 else 1.0, aspect=25)
    return figure


def ambiguity_figure(results: pd.DataFrame, looks: Mapping[str, Look]) -> Figure:
    """Delay of each case against how ambiguous its start was, one small panel per method; failures as crosses."""
    methods = in_order(results["method"])
    usual = results[results["host_reached"]]
    top = max(1.1 * float(usual["delay_s"].quantile(SHOWN)), LEAST_RANGE) if len(usual) else LEAST_RANGE
    right = max(float(results["ambiguity_s"].quantile(SHOWN)), AMBIGUITY_EDGES[-2]) * 1.1
    with canvas.style():
        figure, axes = canvas.grid_of(len(methods), 4, CELL, titles=methods)
        for ax, method in zip(axes, methods, strict=True):
            rows = results[results["method"] == method]
            failed = rows["failed"].to_numpy(dtype=bool)
            x, y = rows["ambiguity_s"].clip(upper=right).to_numpy(), rows["delay_s"].clip(upper=top).to_numpy()
            beyond = (rows["delay_s"].to_numpy() > top) | (rows["ambiguity_s"].to_numpy() > right)
            color = looks[method].color
            ax.scatter(x[~failed & ~beyond], y[~failed & ~beyond], s=7, color=color, alpha=0.45, linewidths=0)
            ax.scatter(x[~failed & beyond], y[~failed & beyond], s=12, marker="^", color=color, alpha=0.45, lw=0)
            ax.scatter(x[failed], y[failed], s=26, marker="x", color=colors.FAILED, linewidths=1.3, zorder=4)
            for edge in AMBIGUITY_EDGES[1:-1]:
                ax.axvline(edge, color=colors.SILVER, lw=0.8, zorder=0)
            ax.set_title(broken(method))
        axes[0].set_xlim(0.0, right * 1.04)
        axes[0].set_ylim(top=top * 1.06)
        figure.supxlabel("$|T_m - T_h|$ at the start [s]", fontsize="medium")
        figure.supylabel("delay [s]", fontsize="medium")
    return figure


def variation_figure(summary: pd.DataFrame, parameter: str, looks: Mapping[str, Look]) -> Figure:
    """Failure rate by the values of one varied parameter, one small panel per source and site.

    Args:
        summary: Summary rows of one scenario; those with `variation` `parameter=value` are drawn as points or bars,
            those without variation as dotted lines.
        parameter: Name of the parameter.
        looks: How the methods are drawn.
    """
    rows = summary.assign(value=summary["variation"].str.partition("=")[2])
    varied = rows[summary["variation"].str.startswith(f"{parameter}=")]
    parts = sorted(varied.groupby(["source", "site"]), key=lambda part: (part[0][0], part[0][1] == ALL_SITES, part[0]))
    values = varied["value"].drop_duplicates().tolist()
    numbers = pd.to_numeric(pd.Series(values), errors="coerce")
    is_scale = bool(numbers.notna().all()) and len(values) > 1
    with canvas.style():
        figure, axes = canvas.grid_of(len(parts), 2, (canvas.WIDTH if len(parts) == 1 else 3.6, canvas.HEIGHT))
        methods = in_order(varied["method"])
        for ax, ((source, site), part) in zip(axes, parts, strict=True):
            base = rows[(rows["variation"] == "") & (rows["source"] == source) & (rows["site"] == site)]
            for i, method in enumerate(methods):
                found = part[part["method"] == method].set_index("value").reindex(values)
                rate = found["failure_pct"].to_numpy(dtype=float)
                low, high = found["ci_low_pct"].to_numpy(dtype=float), found["ci_high_pct"].to_numpy(dtype=float)
                look = looks[method]
                if is_scale:
                    x = numbers.to_numpy(dtype=float)
                    ax.plot(x, rate, look.line, marker=look.mark, ms=4, color=look.color, label=method)
                    ax.fill_between(x, low, high, color=look.color, alpha=0.12, lw=0)
                    for level in base.loc[base["method"] == method, "failure_pct"].dropna():
                        ax.axhline(level, color=look.color, lw=1.0, ls=":")
                else:
                    _bars(ax, i, len(methods), rate, low, high, look, method)
            if not is_scale:
                ax.set_xticks(np.arange(len(values)), values)
                ax.grid(axis="x", visible=False)
            ax.set_title(f"{site} ({source})" if len(parts) > 1 else "")
            ax.set_xlabel(parameter)
        axes[0].set_ylim(0.0, _top(varied))
        axes[0].set_ylabel("failures [%]")
        handles, labels = axes[0].get_legend_handles_labels()
        canvas.legend_below(figure, handles, labels)
    return figure


def _top(varied: pd.DataFrame) -> float:
    """Upper end of the axis of failures [%]: above every point, interval and number."""
    highest = varied[["failure_pct", "ci_high_pct"]].to_numpy(dtype=float)
    return 1.12 * max(float(np.nanmax(highest, initial=0.0)), LEAST_TOP)


def _bars(ax: Any, i: int, n: int, rate: FloatArray, low: FloatArray, high: FloatArray, look: Look, name: str) -> None:
    width = 0.8 / n
    x = np.arange(len(rate)) + (i - (n - 1) / 2) * width
    ax.bar(x, rate, 0.92 * width, color=look.color, label=name)
    if np.isfinite(low).any():
        ax.errorbar(x, rate, [rate - low, high - rate], fmt="none", ecolor=colors.INK, elinewidth=0.8, capsize=2)
    elif n * len(rate) <= MOST_NUMBERS:
        for place, height in zip(x, rate, strict=True):
            ax.annotate(f"{height:.1f}", (place, height), (0, 1), textcoords="offset points", ha="center", fontsize=7)


def _edges(middles: FloatArray) -> FloatArray:
    """Borders of cells, half-way between their middles; a single cell reaches half a m/s to each side."""
    if len(middles) == 1:
        return middles[0] + np.array([-0.5, 0.5])
    between = (middles[1:] + middles[:-1]) / 2
    return np.concatenate([[2 * middles[0] - between[0]], between, [2 * middles[-1] - between[-1]]])

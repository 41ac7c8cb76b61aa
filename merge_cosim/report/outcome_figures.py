"""Figures over all methods: failed or stuck against delay, right decisions by distance, calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from merge_cosim.core import colors
from merge_cosim.core.units import FloatArray
from merge_cosim.report import canvas
from merge_cosim.report.methods import Look

ANGLES = np.arange(16) * np.pi / 8
REACHES = (7.0, 12.0, 18.0, 26.0, 36.0, 50.0, 70.0)
"""Distances from a dot at which its label is tried [pt]."""
ROOM = 1.2
"""The axis of delays reaches this far beyond the longest, so that names have room."""


def tradeoff_figure(rows: Sequence[Mapping[str, Any]], looks: Mapping[str, Look]) -> Figure:
    """Failed or stuck against mean delay: a dot per method with its intervals; references are hollow.

    The axes hold the methods that compete. References beyond are drawn at the edge with their values. The
    rows are those of `page_data.outcome_rows`.
    """
    known = [row for row in rows if row["bad_pct"] is not None and row["delay"] is not None]
    inside = [row for row in known if not row["reference"]] or known
    with canvas.style():
        figure, axes = canvas.panel()
        axes.set(xlabel="mean delay [s]", ylabel="failed or stuck [%]")
        if not known:
            return figure
        delays = [row[name] for row in inside for name in ("delay_low", "delay", "delay_high") if row[name] is not None]
        shares = [row[name] for row in inside for name in ("bad_low", "bad_pct", "bad_high") if row[name] is not None]
        left, right, top = min(0.0, *delays), max(0.1, *delays), min(1.12 * max(1.0, *shares), 104.0)
        right = left + ROOM * (right - left)
        axes.set(xlim=(left, right), ylim=(-0.01 * top, top))
        places = []
        for row in known:
            x, y = float(np.clip(row["delay"], left, right)), float(min(row["bad_pct"], top))
            beyond = (x, y) != (row["delay"], row["bad_pct"])
            look, hollow = looks[row["method"]], row["reference"]
            color = look.color
            if not beyond:
                for low, high, along in (("bad_low", "bad_high", "y"), ("delay_low", "delay_high", "x")):
                    if row[low] is not None:
                        ends = [row[low], row[high]]
                        xs, ys = ([x, x], ends) if along == "y" else (ends, [y, y])
                        axes.plot(xs, ys, color=color, lw=0.9, alpha=0.6, solid_capstyle="butt")
            mark = (">" if row["delay"] > right else "<" if row["delay"] < left else "^") if beyond else look.mark
            size = 8.0 if row["best"] else 5.5
            face = "white" if hollow else color
            axes.plot(x, y, mark, ms=size, mfc=face, mec=color, mew=1.2, clip_on=False, zorder=4)
            far = f" ({row['delay']:.1f} s, {row['bad_pct']:.0f} %)" if beyond else ""
            places.append((x, y, row["method"] + far, row["best"]))
        _label(figure, axes, places)
    return figure


def lines_figure(
    series: Sequence[Mapping[str, Any]],
    looks: Mapping[str, Look],
    labels: tuple[str, str],
    diagonal: bool = False,
) -> Figure:
    """A line with signs per method.

    Args:
        series: Entries with `name`, `x` and `y`.
        looks: How the methods are drawn.
        labels: Labels of both axes.
        diagonal: Draw the line of equal values, and both axes from 0 to 100.
    """
    with canvas.style():
        figure, axes = canvas.panel()
        for one in series:
            look = looks[one["name"]]
            axes.plot(
                one["x"], one["y"], look.line, color=look.color, marker=look.mark, ms=4, lw=1.2, label=one["name"]
            )
        if diagonal:
            axes.plot([0, 100], [0, 100], color=colors.GREY, lw=0.8, ls=(0, (2, 2)))
            axes.set(xlim=(0, 100), ylim=(0, 102))
        axes.set(xlabel=labels[0], ylabel=labels[1])
        canvas.legend_below(figure, *axes.get_legend_handles_labels(), markerscale=0.8)
    return figure


def _label(figure: Figure, axes: Any, places: Sequence[tuple[float, float, str, bool]]) -> None:
    """Name the dots so that no name covers another one or a dot, with a thin line where it stands further away."""
    figure.draw_without_rendering()  # the layout decides where the axes are
    figure.set_layout_engine("none")
    points = axes.transData.transform([(x, y) for x, y, _, _ in places])
    point = figure.dpi / 72
    taken = [Bbox.from_extents(*(at - 5 * point), *(at + 5 * point)) for at in points]
    right, (low, high) = figure.bbox.x1 - 4 * point, axes.bbox.intervaly
    for at, (x, y, name, strong) in zip(points, places, strict=True):
        text = axes.text(x, y, name, fontsize="small", fontweight="bold" if strong else "normal", va="center", zorder=5)
        box = text.get_window_extent()
        found = []
        for reach in REACHES:
            for angle in ANGLES:
                step = reach * point * np.array([np.cos(angle), np.sin(angle)])
                anchor = at + step
                left = anchor[0] - box.width * (0.5 - 0.5 * np.sign(round(np.cos(angle), 1)))
                moved = Bbox.from_bounds(left, anchor[1] - box.height / 2, box.width, box.height)
                outside = moved.x0 < axes.bbox.x0 or moved.x1 > right or moved.y0 < low or moved.y1 > high + 6 * point
                covered = sum(_common(moved, other) for other in taken)
                away = _distances(points, moved)
                nearer = bool((away < _distances(at[None], moved) - point).any())  # it would seem another's name
                found.append((reach + 3 * covered / point**2 + 8 * nearer + 1000 * outside, reach, nearer, moved))
        _, reach, nearer, moved = min(found, key=lambda one: one[0])
        taken.append(moved)
        text.set_position(axes.transData.inverted().transform((moved.x0, moved.y0 + moved.height / 2)))
        if nearer or reach > REACHES[2]:
            end = np.clip(at, [moved.x0, moved.y0], [moved.x1, moved.y1])
            (x0, y0), (x1, y1) = axes.transData.inverted().transform([at, end])
            axes.plot([x0, x1], [y0, y1], color=colors.GREY, lw=0.5, zorder=3, clip_on=False)


def _distances(points: FloatArray, box: Bbox) -> FloatArray:
    """Distance of each point, shape (n, 2), from a box."""
    return np.linalg.norm(points - np.clip(points, box.min, box.max), axis=1)


def _common(one: Bbox, other: Bbox) -> float:
    both = Bbox.intersection(one, other)
    return 0.0 if both is None else float(both.width * both.height)

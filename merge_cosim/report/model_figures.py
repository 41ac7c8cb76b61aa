"""Pictures of what a model learned: speed transitions, times to arrival, and the Gaussian mixture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from merge_cosim.core import colors
from merge_cosim.core.encounter import Intention
from merge_cosim.core.units import FloatArray, IntArray
from merge_cosim.estimators.evidence import SpeedDensity
from merge_cosim.estimators.learned.gaussian import WIDE_BIN
from merge_cosim.estimators.learned.histogram import SPEED_BIN, SPEED_BINS, TIME_BIN
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.pgm import Pgm
from merge_cosim.estimators.pgm_g import PgmG
from merge_cosim.report import canvas

COLORS = {Intention.YIELD: colors.YIELDS, Intention.NOT_YIELD: colors.DOES_NOT_YIELD}
NAMES = {Intention.YIELD: "yield", Intention.NOT_YIELD: "not yield"}
CELL = (2.7, 2.5)
MOST_PANELS = 6
"""Most given speeds that are drawn."""
REACH = 1.45
"""How far from the given speed densities over one cycle are drawn [m/s]."""
LONGEST_TIME = 10.0
"""End of the axes of times to arrival [s]."""
ELLIPSES = (1.0, 2.0)
"""Standard deviations at which a component of the mixture is drawn."""


def transition_figure(model: IntentionModel, lag: int = 1, speeds: Sequence[float] = ()) -> Figure:
    """P(V_t | V_{t-lag}, I) at given speeds for both intentions (as PGM's Fig. 5): histogram, Gaussian and mixture.

    Args:
        model: The model.
        lag: Cycles between the two speeds.
        speeds: Given speeds V_{t-lag} [m/s]; those seen most often if there are none.
    """
    learned = model.speed(lag)
    densities: dict[str, SpeedDensity] = {
        "histogram": learned.histogram.with_background(Pgm().epsilon),
        "Gaussian": learned.gaussian.floored(PgmG().min_sigma),
        "mixture": learned.mixture,
    }
    lines = {"histogram": "-", "Gaussian": "--", "mixture": ":"}
    given = list(speeds) or _usual_speeds(learned.histogram.counts)
    with canvas.style():
        figure, axes = canvas.grid_of(len(given), 3, CELL, sharex=False)
        for ax, speed in zip(axes, given, strict=True):
            now = np.linspace(speed - REACH * lag**0.5, speed + REACH * lag**0.5, 401)
            for name, density in densities.items():
                logs = density.log_density(np.full(len(now), speed), now)
                for i in Intention.YIELD, Intention.NOT_YIELD:
                    width = 2.4 if i == Intention.YIELD else 1.0  # so that both are seen where they agree
                    label = f"{name}, {NAMES[i]}"
                    ax.plot(now, np.exp(logs[i]), lines[name], color=COLORS[i], label=label, lw=width)
            ax.set_yscale("log")
            ax.set_ylim(1e-4, 20)
            seen = learned.histogram.counts[:, int(speed / SPEED_BIN)].sum(axis=1)
            ax.set_title(f"{speed:g} m/s ({seen[0]} + {seen[1]} seen)")
            ax.set_xlabel("$V_t$ [m/s]")
        figure.supylabel(f"$P(V_t | V_{{t-{lag}}}, I)$ [s/m]", fontsize=9)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def arrival_figure(model: IntentionModel) -> Figure:
    """P(T_m, T_h | I) for both intentions (as PGM's Fig. 6), and the log-odds that follow."""
    uniform = Pgm().uniform
    end = int(LONGEST_TIME / TIME_BIN)
    both = model.arrivals.probabilities(uniform)[:, :end, :end] / TIME_BIN**2
    odds = model.arrivals.log_odds(uniform)[:end, :end]
    extent = (0.0, LONGEST_TIME, 0.0, LONGEST_TIME)
    with canvas.style():
        figure, axes = canvas.grid_of(3, 3, CELL)
        for ax, i in zip(axes, (Intention.YIELD, Intention.NOT_YIELD), strict=False):
            shown = ax.imshow(both[i], origin="lower", extent=extent, cmap="viridis", vmin=0, vmax=both.max())
            ax.set_title(f"{NAMES[i]} ({model.pairs[i]} pairs)")
        figure.colorbar(shown, ax=axes[:2], label="density [1/s²]", shrink=0.6)
        top = float(np.abs(odds).max())
        shown = axes[2].imshow(odds, origin="lower", extent=extent, cmap="RdBu_r", vmin=-top, vmax=top)
        axes[2].set_title("log-odds of not yield")
        figure.colorbar(shown, ax=axes[2], shrink=0.6)
        for ax in axes:
            ax.plot([0, LONGEST_TIME], [0, LONGEST_TIME], color=colors.GREY, lw=0.8, ls=":")
            ax.grid(False)
            ax.set(xticks=range(0, int(LONGEST_TIME), 2), yticks=range(0, int(LONGEST_TIME) + 1, 2))
        figure.supxlabel("host's time to arrival $T_h$ [s]", fontsize=9)
        figure.supylabel("merging car's $T_m$ [s]", fontsize=9)
    return figure


def mixture_figure(model: IntentionModel, lag: int = 1) -> Figure:
    """V_{t-lag} x V_t for both intentions (as FG-GMM's Fig. 5): shares of transitions, and the mixture's ellipses.

    Between the two speeds [m/s] lie `lag` cycles.
    """
    learned = model.speed(lag)
    counts = learned.histogram.counts.astype(np.float64)
    shares = counts / counts.sum(axis=(1, 2), keepdims=True)
    used = np.flatnonzero(counts.sum(axis=(0, 2)))
    low, high = max(used[0] - 1, 0) * SPEED_BIN, min(used[-1] + 2, SPEED_BINS) * SPEED_BIN
    edge = SPEED_BINS * SPEED_BIN
    with canvas.style():
        figure, axes = canvas.grid_of(2, 2, (3.6, 3.2))
        norm = LogNorm(vmin=float(shares[shares > 0].min()), vmax=float(shares.max()))
        for ax, i in zip(axes, (Intention.YIELD, Intention.NOT_YIELD), strict=True):
            shown = ax.imshow(
                np.where(shares[i] > 0, shares[i], np.nan).T,
                origin="lower",
                extent=(0, edge, 0, edge),
                cmap="Greys",
                norm=norm,
            )
            for mean, covariance in zip(learned.mixture.means[i], learned.mixture.covariances[i], strict=True):
                for deviations in ELLIPSES:
                    ax.add_patch(_ellipse(mean, covariance, deviations, COLORS[i]))
            ax.set_title(f"{NAMES[i]} ({counts[i].sum():,.0f} transitions)")
            ax.set(xlim=(low, high), ylim=(low, high))
            ax.grid(False)
        figure.colorbar(shown, ax=axes, label="share of transitions", shrink=0.8)
        figure.supxlabel(f"$V_{{t-{lag}}}$ [m/s]", fontsize=9)
        figure.supylabel("$V_t$ [m/s]", fontsize=9)
    return figure


def gaussian_figure(model: IntentionModel) -> Figure:
    """Mean and standard deviation of the change of speed by speed, for both intentions: what PGM-G learned."""
    speed = model.speed(1)
    gaussian = speed.gaussian
    used = np.flatnonzero(speed.histogram.counts.sum(axis=(0, 2))) * SPEED_BIN
    first, last = int(used[0] // WIDE_BIN), int(used[-1] // WIDE_BIN) + 1
    edges = np.arange(first, last + 1) * WIDE_BIN
    floor = PgmG().min_sigma
    with canvas.style():
        figure, axes = canvas.grid_of(2, 2, (3.4, 2.6))
        for ax, values, title in zip(
            axes, (gaussian.mean_change, gaussian.sigma), ("mean change of speed", "standard deviation"), strict=True
        ):
            for i in Intention.YIELD, Intention.NOT_YIELD:
                ax.stairs(values[i, first:last], edges, baseline=None, color=COLORS[i], lw=1.6, label=NAMES[i])
            ax.set_title(title)
        axes[1].axhline(floor, color=colors.GREY, lw=0.8, ls=":")
        axes[1].annotate("floor", (edges[0], floor), (2, 2), textcoords="offset points", fontsize=8, color=colors.GREY)
        axes[0].axhline(0.0, color=colors.GREY, lw=0.8)
        axes[0].legend()
        figure.supxlabel("$V_{t-1}$ [m/s]", fontsize=9)
        figure.supylabel("[m/s]", fontsize=9)
    return figure


def _usual_speeds(counts: IntArray) -> list[float]:
    least = counts.sum(axis=2).min(axis=0)
    often = np.sort(np.argsort(-least, kind="stable")[: min(2 * MOST_PANELS, int((least > 0).sum()))])
    return [(float(i) + 0.5) * SPEED_BIN for i in often[:: 2 if len(often) > MOST_PANELS else 1]]


def _ellipse(mean: FloatArray, covariance: FloatArray, deviations: float, color: str) -> Ellipse:
    variances, axes = np.linalg.eigh(covariance)
    across, along = 2 * deviations * np.sqrt(variances)
    angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
    return Ellipse((mean[0], mean[1]), along, across, angle=angle, fill=False, color=color, lw=1.3)

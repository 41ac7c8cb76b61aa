"""Figures of an estimator's belief: particle clouds, maneuvers over time, the costs that iPCB compares."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.pcb import Pcb
from merge_cosim.core import colors
from merge_cosim.core.encounter import Intention
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.core.units import DT
from merge_cosim.estimators.base import Estimator
from merge_cosim.estimators.dbn_pf import DbnPf, Maneuver, Step
from merge_cosim.estimators.ipcb import Ipcb
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.pgm import Pgm
from merge_cosim.report import canvas
from merge_cosim.report.belief_cases import behind_but_accelerating, pulls_ahead, stays_behind
from merge_cosim.report.methods import KNOWN

COLORS = {Maneuver.YIELD: colors.YIELDS, Maneuver.NOT_YIELD: colors.DOES_NOT_YIELD, Maneuver.IGNORE: colors.IGNORES}
NAMES = {Maneuver.YIELD: "yield", Maneuver.NOT_YIELD: "not yield", Maneuver.IGNORE: "ignore"}
CLOUDS_AT = 5.5
"""When the clouds are drawn [s]: the second driver has just begun to accelerate."""
HOST, MERGING, ACCELERATION = (-60.0, 18.0), (-65.0, 18.0), 1.0
"""The situation for iPCB: station [m] and speed [m/s] of both, and how the merging car accelerates [m/s^2]."""
CYCLES = 30
MOST_COST = 14.0
"""Costs above this are beyond the figure: an overlap costs 1000."""

E = TypeVar("E", bound=Estimator)


def clouds_figure(model: IntentionModel) -> Figure:
    """Particles of DBN-PF before, between and after one update, for the driver that pulls ahead."""
    scenes = pulls_ahead()[: round(CLOUDS_AT / DT) + 1]
    estimator = _ready(DbnPf(), model)
    estimator.watch()
    for scene in scenes:
        estimator.update(scene)
    step = estimator.last_step
    assert step is not None
    earlier = scenes[-1 - round(estimator.interval / DT)]
    panels = {
        f"before: t = {CLOUDS_AT - estimator.interval:g} s": (step.before, earlier),
        f"between: moved to t = {CLOUDS_AT:g} s": (step.between, scenes[-1]),
        "after: weighted, resampled": (step.after, scenes[-1]),
    }
    with canvas.style():
        figure, all_axes = canvas.grid_of(3, 3, (2.9, 3.2))
        for axes, (title, (cloud, scene)) in zip(all_axes, panels.items(), strict=True):
            shares = []
            for one in Maneuver:
                of_it = cloud.maneuver[0] == one
                shares.append(f"{NAMES[one]} {of_it.mean():.0%}")
                axes.plot(cloud.station[0][of_it], cloud.speed[0][of_it], "o", ms=3.2, mew=0, alpha=0.5, c=COLORS[one])
            axes.plot(scene.merging_station, scene.merging_speed, "+", color=colors.INK, ms=12, mew=1.8, zorder=5)
            axes.set_title(f"{title}\n{', '.join(shares)}", loc="left", fontsize=8)
            axes.set_xlabel("station [m]")
        all_axes[0].set_ylabel("speed [m/s]")
        observed = Line2D([], [], color=colors.INK, ls="", marker="+", ms=9, mew=1.8, label="observed")
        dots = [Line2D([], [], color=COLORS[one], ls="", marker="o", ms=4, label=NAMES[one]) for one in Maneuver]
        figure.legend(handles=[*dots, observed], loc="outside lower center", ncols=4)
    return figure


def belief_figure(model: IntentionModel) -> Figure:
    """Shares of the maneuvers and P(not yield) over 12 s, for a driver that stays behind and one that pulls ahead."""
    cases = {"stays behind": stays_behind(), "pulls ahead from 5 s on": pulls_ahead()}
    with canvas.style():
        figure, all_axes = canvas.grid_of(2, 2, (3.9, 3.2))
        for axes, (title, scenes) in zip(all_axes, cases.items(), strict=True):
            estimator = _ready(DbnPf(), model)
            estimator.watch()
            not_yield, shares = [], []
            for scene in scenes:
                not_yield.append(_probability(float(estimator.update(scene)[0])))
                step: Step | None = estimator.last_step
                shares.append(estimator.start_belief if step is None else step.belief[:, 0])
            time = np.arange(len(scenes)) * DT
            for one, share in zip(Maneuver, np.array(shares).T, strict=True):
                axes.step(time, share, where="post", color=COLORS[one], label=NAMES[one])
            axes.step(time, not_yield, where="post", color=colors.INK, lw=1.1, ls=(0, (1, 1.2)), label="P(not yield)")
            axes.set_title(title, loc="left")
            axes.set(xlabel="time [s]", ylim=(-0.02, 1.02), xlim=(0.0, time[-1]))
        all_axes[0].set_ylabel("belief")
        figure.legend(*all_axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def candidates_figure(model: IntentionModel) -> Figure:
    """Cost of iPCB's candidates, and what it and PGM command, where the merging car is behind but accelerates."""
    scenes = behind_but_accelerating(HOST, MERGING, ACCELERATION, CYCLES)
    now, planner = scenes[-1], Pcb()
    planner.start(1, Setting())
    cost = planner.costs(now)[:, :, 0]
    p = _probability(_last_log_odds(Ipcb(), model, scenes))
    expected = (1.0 - p) * cost[Intention.YIELD] + p * cost[Intention.NOT_YIELD]
    pgm = _last_log_odds(Pgm(), model, scenes)
    law = Acc()
    law.start(1, Setting())
    command = float(law.command(now, np.array([pgm]), np.array([pgm >= 0.0]))[0])
    with canvas.style():
        figure, axes = canvas.panel()
        axes.plot(planner.candidates, cost[Intention.YIELD], color=COLORS[Maneuver.YIELD], label="if the driver yields")
        axes.plot(
            planner.candidates,
            cost[Intention.NOT_YIELD],
            color=COLORS[Maneuver.NOT_YIELD],
            label="if the driver does not",
        )
        label = f"ipcb expects, P(not yield) = {p:.2f}"
        axes.plot(planner.candidates, expected, color=KNOWN["ipcb"].color, lw=3.0, alpha=0.7, label=label)
        best = int(expected.argmin())
        axes.plot(planner.candidates[best], expected[best], "o", color=KNOWN["ipcb"].color, ms=9, label="ipcb drives")
        label = f"pgm drives, P(not yield) = {_probability(pgm):.2f}"
        axes.axvline(command, color=KNOWN["pgm"].color, lw=1.4, ls="-.", label=label)
        axes.set(xlabel="candidate acceleration of the host [m/s²]", ylabel="cost", ylim=(0.0, MOST_COST))
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def _ready(estimator: E, model: IntentionModel) -> E:
    estimator.use(model)
    estimator.start(1, Setting())
    estimator.reset(np.array([0]), np.array([int(Intention.UNKNOWN)]), stream_keys(np.array(["figure"]), 0))
    return estimator


def _last_log_odds(estimator: Estimator, model: IntentionModel, scenes: list[Observation]) -> float:
    ready = _ready(estimator, model)
    return [float(ready.update(scene)[0]) for scene in scenes][-1]


def _probability(log_odds: float) -> float:
    return float(0.5 + 0.5 * np.tanh(0.5 * log_odds))

"""Judge the drawn ramps by logged positions: python tools/geometry_page.py --data DIR fills docs/geometry.md.

The page is written by hand but for its blocks `<!-- site: NAME -->` ... `<!-- end -->`.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from blocks import fill_page, page_parser, table
from geometry.lines import SURVEY_FOOT, Line, read_lines
from geometry.plan import Plan
from geometry.positions import positions
from geometry.residuals import judge, lane_centres, origin_of
from geometry.sites import DRAWN, TIES
from matplotlib.axes import Axes
from ramp_geometry import NETS, fitted, plan_of

from merge_cosim.core.units import FOOT, FloatArray
from merge_cosim.ramps.definition import read_ramp_file
from merge_cosim.ramps.ramp import Ramp, read_net

TITLES = {"us101": "US-101", "i80": "I-80"}
SHOWN = {"us101": (-190.0, 480.0), "i80": (-160.0, 260.0)}
"""Part of the road in the pictures [m past the gore]."""
SHIFTS = np.arange(-20.0, 20.1, 1.0)
"""Tried shifts along the road [m]."""
AS_GOOD = 1.05
"""A shift is as good as the best if its residual is at most so many times as large."""


def numbers(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table, fractions with two decimals."""
    return table(
        head, [[f"{cell:.2f}" if isinstance(cell, float) else str(cell) for cell in row] for row in rows]
    ).rstrip()


def residuals(ramp: Ramp, plan: Plan, cars: pd.DataFrame) -> str:
    """Residual of each lane, by all cars, by those that nothing was fitted to, and by the published rows alone."""
    by_all, by_others = judge(ramp, plan.frame, cars), judge(ramp, plan.frame, cars[~fitted(cars)])
    by_rows = judge(ramp, plan.tied, cars)
    rows = [
        [a.number, a.median, a.most, a.cars, a.rows, o.median, o.most, o.bias, o.cars, r.median, r.most]
        for a, o, r in zip(by_all, by_others, by_rows, strict=True)
    ]
    head = ["lane", "median", "95 %", "cars", "rows", "odd: median", "95 %", "to the right", "cars"]
    return numbers([*head, "rows only: median", "95 %"], rows)


def shapes(ramp: Ramp, plan: Plan, drawn: dict[str, Line]) -> str:
    """How far the lanes of the net lie from the drawn centre lines, where these are drawn."""
    centres = lane_centres(ramp, origin_of(ramp))
    rows: list[Sequence[object]] = []
    for number, name in DRAWN[ramp.name].items():
        points = drawn[name].at(np.arange(0.0, drawn[name].length, 2.0))
        along = centres[number].locate(points)[0]
        x = plan.frame.locate(points)[0]
        points = points[(along > 0.0) & (along < centres[number].length) & (x < plan.surveyed["main_after"])]
        off = np.abs(centres[number].locate(points)[1])
        rows.append([number, float(np.median(off)), float(np.percentile(off, 95)), float(off.max())])
    return numbers(("lane", "median", "95 %", "largest"), rows)


def along_road(plan: Plan, drawn: Line, cars: pd.DataFrame) -> str:
    """Which shift along the road fits lanes 7 and 8, where they leave the main road, best to the drawn line."""
    rows: list[Sequence[object]] = []
    for number in (7, 8):
        lane = cars[cars["Lane_ID"] == number]
        spread = []
        for shift in SHIFTS:
            y = lane["Local_Y"].to_numpy(float) + shift / FOOT
            right = drawn.locate(plan.frame.plane(lane["Local_X"].to_numpy(float), y))[1]
            spread.append(np.median(np.abs(right - np.median(right))))
        good = SHIFTS[np.array(spread) <= AS_GOOD * min(spread)]
        rows.append([number, f"{SHIFTS[int(np.argmin(spread))]:.0f}", f"{good.min():.0f} ... {good.max():.0f}"])
    return numbers(("lane", "best shift [m]", f"within {AS_GOOD - 1:.0%} of the best"), rows)


def ties(name: str, ramp: Ramp, plan: Plan) -> str:
    """What the published rows say of each other and of our lanes."""
    points = np.array([tie.plane for tie in TIES[name]]) * SURVEY_FOOT
    x, _ = plan.tied.locate(points)
    apart = np.ptp(x - plan.tied.road(*np.array([tie.local for tie in TIES[name]]).T)[0])
    right = lane_centres(ramp, origin_of(ramp))[2].locate(points)[1]
    moved = plan.frame.zero - plan.tied.zero
    return (
        f"The two rows agree to {100 * apart:.1f} cm along the road. Their car drives in lane 2, "
        f"{abs(right.mean()):.2f} m {'right' if right.mean() > 0 else 'left'} of our lane's centre. The cars of even "
        f"number move the zero of Local_X by {abs(moved):.2f} m to the {'right' if moved > 0 else 'left'}."
    )


def draw(ramp: Ramp, plan: Plan, cars: pd.DataFrame, target: Path) -> None:
    """Lanes with logged positions over them: as on a map, and straightened with the width drawn larger."""
    origin = origin_of(ramp)
    figure, panels = plt.subplots(2, 1, figsize=(13, 10), layout="constrained", height_ratios=(3, 2))
    points = plan.frame.plane(cars["Local_X"].to_numpy(float), cars["Local_Y"].to_numpy(float))
    colors = plt.get_cmap("tab10")(cars["Lane_ID"].to_numpy() - 1)
    views: list[Callable[[FloatArray], FloatArray]] = [
        lambda p: p - origin,
        lambda p: np.column_stack(plan.frame.locate(p)),
    ]
    for panel, view in zip(panels, views, strict=True):
        lanes(panel, ramp, origin, view)
        panel.scatter(*view(points).T, s=0.8, c=colors, linewidths=0, zorder=1)
        panel.spines[["top", "right"]].set_visible(False)
    corners = views[0](plan.frame.place(np.array(SHOWN[ramp.name]), 0.0))
    low, high = corners.min(axis=0), corners.max(axis=0)
    panels[0].set(xlim=(low[0] - 40, high[0] + 40), ylim=(low[1] - 30, high[1] + 30), aspect="equal")
    panels[0].set(xlabel="east of the gore [m]", ylabel="north of the gore [m]")
    half = max(edge.width for edge in plan.edges) / 2
    panels[1].set(xlim=SHOWN[ramp.name], ylim=(half + 10, -half - 2), xlabel="past the gore, along the road [m]")
    panels[1].set(ylabel="to the right [m]")
    present = sorted(set(cars["Lane_ID"]))
    marks = [plt.Line2D([], [], marker="o", linestyle="", color=plt.get_cmap("tab10")(n - 1)) for n in present]
    panels[1].legend(marks, [f"lane {n}" for n in present], ncols=len(present), frameon=False, loc="lower right")
    target.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(target, dpi=80)
    plt.close(figure)


def lanes(panel: Axes, ramp: Ramp, origin: FloatArray, view: Callable[[FloatArray], FloatArray]) -> None:
    """The edges of every lane of a net."""
    for edge in read_net(ramp.net).getEdges():
        for lane in edge.getLanes():
            line = Line(np.array(lane.getShape())[:, :2] + origin)
            stations = np.linspace(0.0, line.length, max(2, round(line.length / 3)))
            for side in (-0.5, 0.5):
                panel.plot(*view(line.place(stations, side * lane.getWidth())).T, color="0.35", linewidth=0.8, zorder=2)


def section(name: str, data: Path, docs: Path) -> str:
    """One site: widths, tables, and a picture in the folder of the page."""
    ramp, plan, cars = Ramp.load(name), plan_of(name, data, read_ramp_file(NETS / name)), positions(data, name)
    drawn = read_lines(data / "geometry" / f"centerlines{'101' if name == 'us101' else '80'}.txt")
    draw(ramp, plan, cars, docs / "img" / f"geometry-{name}.png")
    beside = plan.edges[1]
    widths = ", ".join(f"{width:.2f}" for _, width in reversed(beside.lanes))
    parts = [
        f"Lane widths beside the auxiliary lane, from the left: {widths} m. {ties(name, ramp, plan)}",
        f"![Lanes of {TITLES[name]} with logged positions](img/geometry-{name}.png)",
        "Distance of logged positions from our lane's centre [m]. 'Odd' are the cars that were not used in any fit; "
        "'rows only' is the alignment without any fit to trajectories, for all cars:",
        residuals(ramp, plan, cars),
        "Distance of the drawn centre lines from our lanes' centres [m], where they are drawn:",
        shapes(ramp, plan, drawn),
    ]
    if plan.corrections:
        parts += [
            corrections(plan),
            "How well trajectories determine the position of Local_Y along the road: the shift with which lanes 7 "
            "and 8 fit best to the drawn line, with a free lateral shift:",
            along_road(plan, drawn[DRAWN[name][6]], cars),
        ]
    return "\n\n".join(parts) + "\n"


def corrections(plan: Plan) -> str:
    """What the trajectories change of the drawn line, in words."""
    shifts = []
    for number, each in plan.corrections.items():
        x = each.node + each.sign * np.linspace(0.0, each.seen, 50)
        largest = each.at(x)[np.abs(each.at(x)).argmax()]
        shifts.append(
            f"lane {number} by {each.cars} cars over {each.seen:.0f} m, at most {abs(largest):.2f} m to the "
            f"{'right' if largest > 0 else 'left'}"
        )
    return f"Correction of the drawn line by the cars of even number: {'; '.join(shifts)}."


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the blocks."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with geometry/ and NGSIM's trajectories")
    given = parser.parse_args(argv)

    def site(name: str) -> str | None:
        return None if given.short and name == "us101" else section(name, given.data, given.docs)

    fill_page("geometry.md", given.docs, {"site": site})


if __name__ == "__main__":
    main()

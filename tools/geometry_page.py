"""Judge the drawn ramps by logged positions: python tools/geometry_page.py --data DIR writes docs/geometry.md."""

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from blocks import page_parser, table
from geometry.lines import SURVEY_FOOT, FloatArray, Line, read_lines
from geometry.plan import Plan
from geometry.positions import positions
from geometry.residuals import judge, lane_centres, origin_of
from geometry.sites import DRAWN, TIES
from matplotlib.axes import Axes
from ramp_geometry import NETS, fitted, plan_of

from merge_cosim.core.units import FOOT
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
        f"## {TITLES[name]}",
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
    return "\n\n".join(parts)


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


HEAD = """\
# The geometry of US-101 and I-80

Both nets are true to scale and georeferenced: lane counts and widths, the curve of the road, on-ramp, off-ramp,
gore, auxiliary lane (US-101) and acceleration lane (I-80). In the median logged cars are a few decimetres from the
centre of their lane in the net ([US-101](#us-101), [I-80](#i-80)); where it is worse, and why, is under
[weaknesses](#weaknesses). The plain XML in `sumo_nets/` is written by

    python tools/ramp_geometry.py --data DIR  # DIR/geometry/ and NGSIM's trajectories; writes and builds both
    python tools/geometry_page.py --data DIR  # this page

To build a net again (`merge-cosim ramp build us101`) no survey file is needed. `merge-cosim ramp edit us101` opens it
in netedit; `view.xml` in each folder colours the lanes by their role.

## Sources

- Lane centre lines and road boundaries: NGSIM.jl (MIT), traced from NGSIM's CAD drawings, in feet of the California
  state plane, NAD83 (US-101: zone V, EPSG:2229; I-80: zone III, EPSG:2227).
- Trajectories: the fragments of NGSIM that the data folder holds; of I-80 single cars, which is enough for
  the geometry.
- One place in both coordinates: the first two rows of NGSIM's own files `trajectories-0750am-0805am.txt` (US-101)
  and `trajectories-0400-0415.txt` (I-80), as many tutorials print them: Local_X, Local_Y with Global_X, Global_Y.

## How the drawing becomes a net

- **Plane.** Feet are US survey feet (1200/3937 m). The nets are in metres of EPSG:26945 (zone V) and EPSG:26943
  (zone III), shifted so that (0, 0) is the host lane's axis at the gore; `<location>` says by how much, so that
  netedit and sumo-gui can lay a map behind the net.
- **Main road.** One axis: the mean of the drawn centre lines, each shifted by its lane's position across the road,
  averaged over 30 m, because the tracing varies by about 0.15 m. Lane widths are the mean distances of the painted
  boundaries. Corners that change the shape by less than 2 cm are left out.
- **Along the road.** x = Local_Y - Local_Y of the gore is arc length along that axis, with the offset that the
  published rows give. SUMO's edge lengths are set to it, so every station is exact.
- **Across the road.** Local_X is distance across that axis. Its zero is set by the cars of even number, so that the
  lanes with a drawn centre line (1 to 6 of US-101, 1 to 5 of I-80) have no common shift, in the mean over lanes of
  each lane's median.
- **US-101's ramps.** Lanes 7 and 8 have no centre line of their own; the auxiliary lane's runs on into both. It is
  followed, corrected by a parabola that is fitted to the cars of even number, is zero at the auxiliary lane and
  fades out over 40 m where no car was seen. Upstream the on-ramp follows the outer edge of its loop, half a lane
  width inside; downstream the off-ramp follows its left edge.
- **I-80's acceleration lane** keeps to the right edge of the road and so runs slantwise into lane 6: the two
  overlap. The sixth lane has no right edge of its own in the drawing; it is as wide as the fifth.
- **Beyond the survey** every road goes straight on; `[extensions]` in `ramp.toml` says where.
"""

TAIL = """\
## Weaknesses

- The alignment along the road rests on two published rows at the upstream end; an error in NGSIM's scale would show
  at the other end. The lateral positions of all lanes together vary by up to a metre along the road, an error
  of NGSIM's cameras. That, and how people drive, is most of the residual.
- **Lane 6 of US-101**: merging cars keep to the left of it. They are part of the mean that sets Local_X, so lanes 1 to
  5 are left with a small shift the other way. That lane 6 is part of this mean was decided after the alternative had
  been seen: with lanes 1 to 5 only, its median is 0.63 m. The column 'rows only' does not depend on this.
- Around Local_Y 1,390 to 1,410 ft of US-101 the positions of all lanes jump sideways and back by metres, probably
  where the images of two cameras meet.
- **Lane 8 of US-101**: few cars over 20 m of road; beyond Local_Y 1,380 ft, at that place, its positions are
  left out.
- **Lane 6 of I-80**: on-ramp cars count for it from Local_Y 667 ft on, wherever they are across the road; they make
  its large distances.
- **Lane 7 of I-80**: the source begins each car where it comes within 81.6 ft of the road's left edge, so the right
  half of the on-ramp is seen too seldom.
- The road behind I-80's survey keeps six lanes; the real one loses its sixth to the next off-ramp, 505 m past the
  gore.
- The speed limit is the same on the loop of US-101's on-ramp as on the freeway: no car could drive it that fast.
- The road is flat: heights are left out.
"""


def main(argv: Sequence[str] | None = None) -> None:
    """Write the page."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with geometry/ and NGSIM's trajectories")
    given = parser.parse_args(argv)
    (given.docs / "img").mkdir(parents=True, exist_ok=True)
    names = list(TITLES)[-1:] if given.short else TITLES
    parts = [HEAD.strip(), *(section(name, given.data, given.docs) for name in names), TAIL.strip()]
    (given.docs / "geometry.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

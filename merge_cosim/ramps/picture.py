"""A picture of a ramp, so that a wrong guess can be seen: both paths, the gore, the merging point."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from merge_cosim.core import colors
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FloatArray
from merge_cosim.ramps import polyline
from merge_cosim.ramps.definition import RampFile, read_ramp_file
from merge_cosim.ramps.ramp import Ramp, read_net

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PICTURE = "ramp.png"
"""The picture's name, beside `ramp.toml`."""
AROUND_GORE = (120.0, 80.0)
"""Road shown in the lower part before the gore and after the end of the acceleration lane [m]."""
MAX_CLOSE = 600.0
"""As much of an acceleration lane is shown in the lower part [m]."""
MARGIN = 40.0
"""Surroundings shown on either side of the road [m]."""
COLORS = {
    "other roads": colors.PALE,
    "main road": colors.MAIN_ROAD,
    "on-ramp": colors.ON_RAMP,
    "host's lane": colors.HOST,
    "merging car's lane": colors.MERGING,
}
"""Colour of each kind of lane; the later ones are drawn over the earlier."""


def draw(folder: Path) -> Path:
    """Draw the ramp of a folder into `ramp.png` there, the main road from left to right.

    Raises:
        UserError: `ramp.toml` or the net is wrong, or the picture cannot be written.
    """
    from matplotlib.figure import Figure

    file = read_ramp_file(folder)
    ramp, net = Ramp.from_file(folder, file), read_net(folder / file.net)
    turned = _Turned(net, file)
    figure = Figure(figsize=(14, 6))  # margins are given: to find them takes as long as to draw
    figure.subplots_adjust(left=0.05, right=0.99, top=0.94, bottom=0.16, hspace=0.25)
    whole, close = figure.subplots(2, 1, height_ratios=(1, 1.4))
    for axes in (whole, close):
        _lanes(axes, net, file, turned)
        _marks(axes, net, file, ramp, turned)
        axes.set_aspect("equal")
    lines = {
        kind: np.vstack([turned(net.getEdge(one.edge).getLane(one.lane).getShape()) for one in path])
        for kind, path in (("host's lane", ramp.main), ("merging car's lane", ramp.ramp))
    }
    for kind, line in lines.items():
        whole.plot(*line.T, color=COLORS[kind], lw=1.5, zorder=8)
    on_paths = np.vstack(list(lines.values()))
    whole.set_xlim(on_paths[:, 0].min() - MARGIN, on_paths[:, 0].max() + MARGIN)
    whole.set_ylim(on_paths[:, 1].min() - MARGIN, on_paths[:, 1].max() + MARGIN)
    end = min(ramp.auxiliary_end if ramp.changes_lane else 0.0, MAX_CLOSE)
    close.set_xlim(-AROUND_GORE[0], end + AROUND_GORE[1])
    close.set_ylim(-MARGIN / 2, MARGIN / 2)
    close.set_xlabel("m past the gore, along the main road there")
    whole.set_title(f"{file.title}: {file.net}", fontsize="medium")
    figure.legend(*close.get_legend_handles_labels(), loc="lower center", fontsize="small", ncols=7)
    target = folder / PICTURE
    try:
        figure.savefig(target, dpi=110)
    except OSError as error:
        raise UserError(f"{target}: cannot be written ({error.strerror})") from None
    return target


class _Turned:
    """Places in the plane with the gore at (0, 0) and the main road along x there."""

    def __init__(self, net: Any, file: RampFile) -> None:
        shape = np.array(net.getEdge(file.gore).getLane(file.host_lane[file.main.index(file.gore)]).getShape())
        along = polyline.directions(polyline.through(list(shape[:, :2])))[0]
        self._origin, self._turn = shape[0, :2], np.stack([along, polyline.left_of(along)])

    def __call__(self, shape: Sequence[Any]) -> FloatArray:
        return np.asarray((np.array(shape, dtype=float)[:, :2] - self._origin) @ self._turn.T)


def _lanes(axes: Axes, net: Any, file: RampFile, turned: _Turned) -> None:
    """Every lane near the paths, as wide as it is; the paths' lanes in their colours."""
    host = dict(zip(file.main, file.host_lane, strict=True))
    merging = dict(zip(file.ramp, file.merging_lane, strict=True))
    on_paths = np.vstack([turned(net.getEdge(name).getShape()) for name in (*host, *merging)])
    low, high = on_paths.min(axis=0) - MARGIN, on_paths.max(axis=0) + MARGIN
    named = set[str]()
    for edge in net.getEdges():
        name = edge.getID()
        for lane in edge.getLanes():
            shape = turned(lane.getShape())
            if (shape.max(axis=0) < low).any() or (shape.min(axis=0) > high).any():
                continue
            kind = "main road" if name in host else "on-ramp" if name in merging else "other roads"
            kind = "merging car's lane" if merging.get(name) == lane.getIndex() else kind
            kind = "host's lane" if host.get(name) == lane.getIndex() else kind
            line, half = polyline.through(list(shape)), lane.getWidth() / 2
            outline = np.vstack([polyline.beside(line, half), polyline.beside(line, -half)[::-1]])
            label = None if kind in named else kind
            order = list(COLORS).index(kind)
            axes.fill(*outline.T, facecolor=COLORS[kind], lw=0.4, ec="white", zorder=order, label=label)
            named.add(kind)


def _marks(axes: Axes, net: Any, file: RampFile, ramp: Ramp, turned: _Turned) -> None:
    """The gore and the merging point, beside the host's lane."""
    axes.axvline(0.0, color="black", lw=1.0, ls="--", zorder=9, label="gore")
    after = [section for section in ramp.main if section.end > ramp.merging_point]
    section = next(one for one in after if one.start <= ramp.merging_point)
    line = polyline.through(list(turned(net.getEdge(section.edge).getLane(section.lane).getShape())))
    share = (ramp.merging_point - section.start) / section.length
    ways = polyline.ways(line)
    place = [np.interp(share * ways[-1], ways, line[:, axis]) for axis in (0, 1)]
    label = f"merging point, {ramp.merging_point:g} m"
    axes.plot(*place, marker="*", ms=16, color="gold", mec="black", ls="", zorder=10, label=label)

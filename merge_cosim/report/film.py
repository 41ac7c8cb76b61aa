"""One case from above, as stills or as a video: the ramp as it is built, all cars, belief and decision."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from merge_cosim.core import colors
from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT, FloatArray
from merge_cosim.ramps.export.lanelets import Lanelet, lanelets
from merge_cosim.ramps.export.poses import poses
from merge_cosim.ramps.ramp import Ramp, Way
from merge_cosim.report.canvas import style

VIDEOS, STILLS = (".mp4", ".gif"), (".png", ".svg", ".pdf")
FPS = round(1.0 / DT)
"""Frames per second: one per cycle, in real time."""
HELD = FPS
"""How often the last frame is repeated, so that the outcome can be read."""
SIZE, DOTS = (9.6, 4.0), 100
"""Size of a frame [in], and its dots per inch."""
BEHIND, AHEAD = 110.0, 70.0
"""What is shown behind and ahead of the host [m]."""
ROAD_SHARE = 0.56
"""Share of the frame's height that the road takes."""
CAR_WIDTH = 1.8
"""Width of every car [m]; encounters hold lengths only."""
NAMES_AT = 3.4
"""How far above the host and below the merging car their names stand [m]."""


@dataclass(frozen=True)
class Stage:
    """Where a case takes place.

    Attributes:
        ramp: The ramp.
        host: The host's path; the other car is on the other one.
        lengths: Lengths of the host and the merging car [m].
        merge_position: The merging point [m past the gore].
    """

    ramp: Ramp
    host: Way = "main"
    lengths: tuple[float, float] = (5.0, 5.0)
    merge_position: float = 0.0


def check_file(option: str, file: str | Path, kinds: tuple[str, ...]) -> None:
    """Refuse a file of another kind, or a video that cannot be encoded, before anything is run.

    Args:
        option: What the file was given as, for the message.
        file: The file.
        kinds: The suffixes that there are.

    Raises:
        UserError: The file has another suffix, or there is no encoder.
    """
    suffix = Path(file).suffix.lower()
    if suffix not in kinds:
        raise UserError(f"{option} {file}: is written as {', '.join(kinds[:-1])} or {kinds[-1]}")
    if suffix == ".mp4" and find_spec("imageio_ffmpeg") is None and shutil.which("ffmpeg") is None:
        raise UserError(f"{option} {file}: needs ffmpeg: pip install 'merge-cosim[video]', or give a .gif")


class Film:
    """The frames of one case."""

    def __init__(
        self, stage: Stage, record: pd.DataFrame, title: str, outcome: str, others: pd.DataFrame | None = None
    ) -> None:
        """Make ready to draw.

        Args:
            stage: Where it takes place.
            record: One row per cycle.
            title: What stands above every frame.
            outcome: What stands there in the last one.
            others: Where the other cars are, as `sweeps.other_cars` finds them; None without any.
        """
        self._stage, self._record, self._title, self._outcome = stage, record.reset_index(drop=True), title, outcome
        paths: tuple[Way, Way] = ("main", "ramp") if stage.host == "main" else ("ramp", "main")
        self._road = {name: _turned(lane, self._origin, self._turn) for name, lane in lanelets(stage.ramp).items()}
        columns = ("host_station_m", "merging_station_m")
        self._cars = [
            poses(self._road, stage.ramp, path, record[column].to_numpy(dtype=float), length, stage.merge_position)
            for path, column, length in zip(paths, columns, stage.lengths, strict=True)
        ]
        self._others = {} if others is None else self._bodies_of(others)
        odds = record["log_odds"].to_numpy(dtype=float)
        self._belief = 0.5 + 0.5 * np.tanh(0.5 * odds)

    def __len__(self) -> int:
        return len(self._record)

    @property
    def _origin(self) -> FloatArray:
        return self._merging_point[0]

    @property
    def _turn(self) -> FloatArray:
        return self._merging_point[1]

    @cached_property
    def _merging_point(self) -> tuple[FloatArray, FloatArray]:
        """Where station 0 is on the main road, and what turns the road there along x."""
        ramp = self._stage.ramp
        place = poses(lanelets(ramp), ramp, "main", np.zeros(1), 0.0, self._stage.merge_position)
        heading = float(place[1][0])
        along = np.array([np.cos(heading), np.sin(heading)])
        return place[0][0], np.stack([along, [-along[1], along[0]]])

    def _bodies_of(self, others: pd.DataFrame) -> dict[int, FloatArray]:
        """By cycle, the corners of the other cars, shape (cars, 4, 2); those of the first cycle are not known."""
        heading = others["heading"].to_numpy() - np.arctan2(self._turn[0, 1], self._turn[0, 0])
        length = others["length_m"].to_numpy()
        front = (others[["x_m", "y_m"]].to_numpy() - self._origin) @ self._turn.T
        centre = front - 0.5 * length[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        for name, rows in others.reset_index(drop=True).groupby("lane").groups.items():
            if name in self._road:  # as the two cars are placed; SUMO's own lanes end before junctions
                middle = others["pos_m"].to_numpy()[rows] - 0.5 * length[rows]
                centre[rows] = self._road[str(name)].at(middle)
        corners = _corners(centre, heading, length)
        cycles = np.rint(others["time_s"].to_numpy() / DT).astype(int)
        return {int(cycle): corners[cycles == cycle] for cycle in np.unique(cycles)}

    def stills(self, count: int) -> Iterator[Figure]:
        """A number of frames at equal distances over the case, the last one included."""
        for number in np.linspace(0, len(self) - 1, count).round().astype(int):
            with style():
                frame = _Frame(self._road)
                self._show(frame, int(number))
            yield frame.figure

    def write(self, file: Path) -> None:
        """Write a video (.mp4 or .gif) in real time."""
        from matplotlib.animation import FFMpegWriter, PillowWriter

        file.parent.mkdir(parents=True, exist_ok=True)
        with style(), _encoder():
            frame = _Frame(self._road)
            gif = file.suffix.lower() == ".gif"
            more = ["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
            writer: Any = PillowWriter(fps=FPS) if gif else FFMpegWriter(fps=FPS, codec="libx264", extra_args=more)
            with writer.saving(frame.figure, str(file), DOTS):
                for number in [*range(len(self)), *[len(self) - 1] * HELD]:
                    self._show(frame, number)
                    writer.grab_frame()

    def _show(self, frame: _Frame, number: int) -> None:
        now = self._record.iloc[number]
        cars = [(centres[number], float(headings[number])) for centres, headings in self._cars]
        frame.cars(cars, self._stage.lengths)
        cycle = round(float(now["time_s"]) / DT)
        frame.others.set_verts(list(self._others.get(cycle, self._others.get(cycle + 1, ()))))
        last = number == len(self) - 1
        frame.texts["title"].set_text(f"{self._title}{': ' + self._outcome if last else ''}")
        frame.texts["clock"].set_text(f"{now['time_s'] - self._record['time_s'].iloc[0]:5.1f} s")
        belief, follows = float(self._belief[number]), bool(now["not_yield"])
        frame.belief.set_width(0.0 if np.isnan(belief) else belief)
        frame.texts["belief"].set_text("no belief" if np.isnan(belief) else f"{belief:.2f}")
        frame.texts["decision"].set_text("follows it" if follows else "goes first")
        for car, name in (("host", "host"), ("merging", "merging car")):
            line = f"{name:11s} {now[f'{car}_speed_m_s']:5.1f} m/s {now[f'{car}_station_m']:7.1f} m"
            frame.texts[car].set_text(line + (f" {now['host_acceleration_m_s2']:+5.1f} m/s²" if car == "host" else ""))


class _Frame:
    """A figure whose cars, bar and texts are changed from frame to frame."""

    def __init__(self, road: dict[str, Lanelet]) -> None:
        self.figure = Figure(figsize=SIZE, dpi=DOTS)
        self._axes = axes = self.figure.add_axes((0.0, 1.0 - ROAD_SHARE - 0.1, 1.0, ROAD_SHARE), xticks=[], yticks=[])
        axes.set_aspect("equal", adjustable="box")
        for side in axes.spines.values():
            side.set_visible(False)
        axes.grid(visible=False)
        for lane in road.values():
            axes.add_patch(Polygon(np.concatenate([lane.left, lane.right[::-1]]), facecolor=colors.ROAD, lw=0))
        for lane in road.values():
            if lane.left_lane is not None:
                axes.plot(*lane.left.T, color="white", lw=1.4, ls=(0, (6, 6)))
        half = 0.5 * (BEHIND + AHEAD) * ROAD_SHARE * SIZE[1] / SIZE[0]
        axes.set_ylim(-half, half)
        axes.axvline(0.0, color=colors.GREY, lw=1.0, ls=":")
        axes.text(0.8, half * 0.86, "merging point", color=colors.GREY, fontsize=8, clip_on=True)
        self.others = PolyCollection([], facecolor=colors.OTHER, edgecolor=colors.GREY, lw=0.6, zorder=4)
        axes.add_collection(self.others, autolim=False)
        self._bodies = [
            Polygon(np.zeros((4, 2)), facecolor=color, edgecolor="black", lw=0.8, hatch=hatch, zorder=5)
            for color, hatch in ((colors.HOST, None), (colors.MERGING, "////"))
        ]
        for body in self._bodies:
            axes.add_patch(body)
        self._names = [
            axes.text(0, 0, name, ha="center", va=va, fontsize=9, color=color, clip_on=True, zorder=6)
            for name, color, va in (("host", colors.HOST, "bottom"), ("merging car", colors.MERGING, "top"))
        ]
        self.belief = self._bar()
        place: dict[str, Any] = {"transform": self.figure.transFigure}
        text = self.figure.text
        text(0.02, 0.235, "P(merging car does not yield)", fontsize=10)
        text(0.40, 0.235, "the host", fontsize=10)
        self.texts = {
            "title": text(0.02, 0.935, "", fontsize=11, fontweight="bold", **place),
            "clock": text(0.98, 0.935, "", fontsize=11, ha="right", family="monospace", **place),
            "belief": text(0.345, 0.117, "", fontsize=12, va="center", ha="right", **place),
            "decision": text(0.40, 0.10, "", fontsize=16, fontweight="bold", **place),
            "host": text(0.58, 0.19, "", fontsize=10, family="monospace", color=colors.HOST, **place),
            "merging": text(0.58, 0.09, "", fontsize=10, family="monospace", color=colors.MERGING, **place),
        }

    def _bar(self) -> Rectangle:
        axes = self.figure.add_axes((0.02, 0.08, 0.27, 0.075), xlim=(0, 1), ylim=(0, 1), yticks=[])
        axes.set_xticks([0, 0.5, 1], ["0", "½", "1"], fontsize=8)
        axes.grid(visible=False)
        axes.axvline(0.5, color=colors.GREY, lw=1.0)
        bar = Rectangle((0, 0), 0.0, 1.0, facecolor=colors.INDIGO)
        axes.add_patch(bar)
        return bar

    def cars(self, poses: list[tuple[FloatArray, float]], lengths: tuple[float, float]) -> None:
        """Move the cars, host first, to their centres and headings, and the window with the host."""
        self._axes.set_xlim(poses[0][0][0] - BEHIND, poses[0][0][0] + AHEAD)
        for (centre, heading), length, body, name, side in zip(
            poses, lengths, self._bodies, self._names, (1.0, -1.0), strict=True
        ):
            body.set_xy(_corners(centre[None], np.array([heading]), np.array([length]))[0])
            name.set_position((centre[0], centre[1] + side * NAMES_AT))


def _corners(centre: FloatArray, heading: FloatArray, length: FloatArray) -> FloatArray:
    """Corners of n cars, shape (n, 4, 2)."""
    along = 0.5 * length[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    across = 0.5 * CAR_WIDTH * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    return np.stack(
        [centre + one for one in (along + across, along - across, -along - across, -along + across)], axis=1
    )


def _turned(lane: Lanelet, origin: FloatArray, turn: FloatArray) -> Lanelet:
    """A lane in coordinates with the merging point at (0, 0) and the main road along x there."""
    left, right = ((side - origin) @ turn.T for side in (lane.left, lane.right))
    return Lanelet(**{**vars(lane), "left": left, "right": right})


@contextmanager
def _encoder() -> Iterator[None]:
    """The context in which matplotlib finds ffmpeg: that of the package imageio-ffmpeg, or the system's."""
    if find_spec("imageio_ffmpeg") is None:
        yield
        return
    from imageio_ffmpeg import get_ffmpeg_exe

    with mpl.rc_context({"animation.ffmpeg_path": get_ffmpeg_exe()}):
        yield

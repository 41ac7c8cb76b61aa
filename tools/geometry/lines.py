"""Plane curves as polylines in metres, and the survey files of lane centre lines and road boundaries."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter1d

from merge_cosim.core.units import FloatArray
from merge_cosim.ramps import polyline

SURVEY_FOOT = 1200 / 3937
"""US survey foot [m], the unit of the California state plane (EPSG:2229, 2227); in metres it is EPSG:26945, 26943."""


@dataclass(frozen=True)
class Line:
    """A polyline in driving direction.

    Attributes:
        points: Its corners, (n, 2) [m].
        ends: Length at either end that gives the direction in which the line goes on beyond it [m].
    """

    points: FloatArray
    ends: float = 30.0

    @cached_property
    def stations(self) -> FloatArray:
        """Arc length of each corner from the start, (n,) [m]."""
        return polyline.ways(self.points)

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self.stations[-1])

    def at(self, stations: FloatArray) -> FloatArray:
        """Points at arc lengths [m], (n, 2); beyond an end the line goes straight on."""
        stations = np.atleast_1d(np.asarray(stations, dtype=float))
        inside = np.column_stack([np.interp(stations, self.stations, axis) for axis in self.points.T])
        for end, beyond in ((0.0, np.minimum(stations, 0.0)), (self.length, np.maximum(stations - self.length, 0.0))):
            inside += beyond[:, None] * self._direction(end)
        return inside

    def _direction(self, end: float) -> FloatArray:
        """Unit vector along the road beside an end."""
        near = abs(end - min(self.ends, self.length))
        chord = np.column_stack([np.interp(sorted((end, near)), self.stations, axis) for axis in self.points.T])
        along = chord[1] - chord[0]
        return np.asarray(along / np.hypot(*along))

    def normals(self, stations: FloatArray) -> FloatArray:
        """Unit vectors to the right of the driving direction, from chords of 2 m, (n, 2)."""
        stations = np.atleast_1d(np.asarray(stations, dtype=float))
        along = self.at(stations + 1.0) - self.at(stations - 1.0)
        along /= np.hypot(*along.T)[:, None]
        return np.column_stack([along[:, 1], -along[:, 0]])

    def place(self, stations: FloatArray, right: FloatArray | float) -> FloatArray:
        """Points `right` metres to the right of the line at arc lengths [m], (n, 2)."""
        right = np.broadcast_to(np.asarray(right, dtype=float), np.shape(np.atleast_1d(stations)))
        return self.at(stations) + right[:, None] * self.normals(stations)

    def locate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Arc length of the foot and distance to the right of points (n, 2), both (n,) [m].

        The ends count as straight roads without end.
        """
        ends = self.at(np.array([-1e4, self.length + 1e4]))
        corners = np.vstack([ends[:1], self.points, ends[1:]])
        start, along = corners[:-1], np.diff(corners, axis=0)
        length = np.hypot(*along.T)
        before = np.concatenate([[-1e4], self.stations])
        station, right = np.empty(len(points)), np.empty(len(points))
        for rows in np.array_split(np.arange(len(points)), max(1, len(points) // 2000)):
            apart = points[rows, None] - start
            share = np.clip(np.einsum("ijk,jk->ij", apart, along) / length**2, 0.0, 1.0)
            distance = np.hypot(*np.moveaxis(apart - share[..., None] * along, -1, 0))
            near = distance.argmin(axis=1)
            each = np.arange(len(rows))
            station[rows] = before[near] + share[each, near] * length[near]
            cross = along[near, 1] * apart[each, near, 0] - along[near, 0] * apart[each, near, 1]
            right[rows] = np.sign(cross) * distance[each, near]
        return station, right

    def part(self, start: float, end: float) -> Line:
        """The piece between two arc lengths [m], which may lie beyond the ends."""
        inner = self.stations[(self.stations > start + 1e-6) & (self.stations < end - 1e-6)]
        return Line(self.at(np.concatenate([[start], inner, [end]])), self.ends)

    def beside(self, right: float) -> Line:
        """The parallel line `right` metres to the right."""
        return Line(self.place(self.stations, right), self.ends)

    def smooth(self, window: float, step: float = 2.0) -> Line:
        """Sampled every `step` metres and averaged over `window` metres; its ends stay where they are."""
        stations = np.linspace(0.0, self.length, round(self.length / step) + 1)
        reach = round(window / step)
        longer = self.at(
            np.concatenate([np.arange(-reach, 0) * step, stations, self.length + step * np.arange(1, reach)])
        )
        return Line(uniform_filter1d(longer, 2 * (reach // 2) + 1, axis=0)[reach : reach + len(stations)], self.ends)

    def simple(self, tolerance: float) -> Line:
        """Fewer corners, none of the dropped ones further than `tolerance` [m] off (Douglas and Peucker 1973)."""
        keep = np.zeros(len(self.points), dtype=bool)
        keep[[0, -1]] = True
        stack = [(0, len(self.points) - 1)]
        while stack:
            first, last = stack.pop()
            if last - first < 2:
                continue
            chord = Line(self.points[[first, last]])
            off = np.abs(chord.locate(self.points[first + 1 : last])[1])
            if off.max() > tolerance:
                middle = first + 1 + int(off.argmax())
                keep[middle] = True
                stack += [(first, middle), (middle, last)]
        return Line(self.points[keep], self.ends)


def read_lines(path: Path) -> dict[str, Line]:
    """Read a survey file of NGSIM.jl, in state-plane feet: lines by name, in driving order as they stand there.

    Boundaries are called `boundary1` and so on; the auxiliary lane's centre line `auxilliary`, as in the file.
    """
    rows = iter(path.read_text(encoding="ascii").split("\n"))
    lines: dict[str, Line] = {}
    for row in rows:
        word = row.strip()
        if word == "CENTERLINE":
            name = next(rows).strip()
        elif word.startswith("BOUNDARY "):
            name = word.replace("BOUNDARY ", "boundary")
        else:
            continue
        count = int(next(rows))
        points = np.array([[float(number) for number in next(rows).split()] for _ in range(count)])
        lines[name] = Line(points * SURVEY_FOOT)
    return lines

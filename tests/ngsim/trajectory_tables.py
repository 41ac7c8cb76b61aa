"""Small trajectory tables built by hand: cars with a constant speed unless positions are given."""

from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa

from merge_cosim.ngsim.sites import site
from merge_cosim.ngsim.table import SCHEMA

US101 = site("us101")

GORE = US101.gore_y


@dataclass(frozen=True)
class Car:
    """A car's track: one lane per frame, and its positions [m] past the gore."""

    vehicle: int
    lanes: list[int]
    position: np.ndarray
    frame: int = 0
    part: int = 1
    recording: str = "r"
    length: float = 4.0
    smoothed: bool = False
    speed: np.ndarray | None = field(default=None)


def steady(vehicle: int, lanes: list[int], at: float, speed: float = 15.0, frame: int = 0, **more: object) -> Car:
    """A car at `at` [m] past the gore in frame 0 of the recording's clock."""
    position = at + speed * 0.1 * (frame + np.arange(len(lanes)))
    return Car(vehicle, lanes, position, frame, speed=np.full(len(lanes), speed), **more)


def table(*cars: Car) -> pa.Table:
    """The canonical table of these cars, sorted."""
    rows = []
    for car in sorted(cars, key=lambda c: (c.recording, c.vehicle, c.part, c.frame)):
        speed = np.gradient(car.position, 0.1) if car.speed is None else car.speed
        for k, lane in enumerate(car.lanes):
            row = ("us101", car.recording, car.vehicle, car.part, car.frame + k, 0.0, GORE + car.position[k], speed[k])
            rows.append((*row, car.length, 2.0, lane, car.smoothed))
    columns = [pa.array(column) for column in zip(*rows, strict=True)]
    dictionary = [column.dictionary_encode() if index < 2 else column for index, column in enumerate(columns)]
    return pa.table(dictionary, names=SCHEMA.names).cast(SCHEMA)

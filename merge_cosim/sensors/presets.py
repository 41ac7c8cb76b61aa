"""The noisy sensor with values of common kinds. They are round numbers of that order, not those of a device."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from pydantic import Field, NonNegativeFloat

from merge_cosim.sensors.base import sensors
from merge_cosim.sensors.noisy import Noisy


@sensors.register
@dataclass(kw_only=True)
class Radar(Noisy):
    """Like an automotive radar: quick, speeds better than positions, coarse steps, few and short dropouts."""

    name: ClassVar[str] = "radar"
    delay: Annotated[float, Field(ge=0, le=10)] = 0.1
    station_sigma: NonNegativeFloat = 0.4
    speed_sigma: NonNegativeFloat = 0.1
    station_step: NonNegativeFloat = 0.2
    speed_step: NonNegativeFloat = 0.1
    dropout: Annotated[float, Field(ge=0, le=0.99)] = 0.02
    dropout_time: NonNegativeFloat = 0.3


@sensors.register
@dataclass(kw_only=True)
class Camera(Noisy):
    """Like a camera: distance and speed from the size of the image, so coarse and correlated in time, with dropouts."""

    name: ClassVar[str] = "camera"
    delay: Annotated[float, Field(ge=0, le=10)] = 0.2
    station_sigma: NonNegativeFloat = 1.5
    speed_sigma: NonNegativeFloat = 0.8
    time_constant: NonNegativeFloat = 0.5
    dropout: Annotated[float, Field(ge=0, le=0.99)] = 0.05
    dropout_time: NonNegativeFloat = 0.5


@sensors.register
@dataclass(kw_only=True)
class Late(Noisy):
    """Exact, but half a second old."""

    name: ClassVar[str] = "late"
    delay: Annotated[float, Field(ge=0, le=10)] = 0.5


@sensors.register
@dataclass(kw_only=True)
class Coarse(Noisy):
    """White noise of 1 m and 0.5 m/s, 0.3 s old: a common ground on which methods are compared."""

    name: ClassVar[str] = "coarse"
    delay: Annotated[float, Field(ge=0, le=10)] = 0.3
    station_sigma: NonNegativeFloat = 1.0
    speed_sigma: NonNegativeFloat = 0.5

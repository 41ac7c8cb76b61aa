"""SUMO's bit sets for what a vehicle does by itself besides the commands that it gets.

Source: SUMO's documentation, page "TraCI/Change Vehicle State", sections "speed mode (0xb3)" and "lane change mode
(0xb6)".
"""

from enum import IntFlag


class SpeedMode(IntFlag):
    """Which checks SUMO makes on a commanded speed."""

    SAFE_SPEED = 1
    """Not faster than the car-following model holds for safe."""
    MAX_ACCELERATION = 2
    """Not beyond the type's acceleration."""
    MAX_DECELERATION = 4
    """Not beyond the type's deceleration."""
    RIGHT_OF_WAY = 8
    """Give way to vehicles that approach an intersection."""
    RED_LIGHT = 16
    """Brake hard rather than pass a red light."""
    IGNORE_FOES_INSIDE = 32
    """Give no way to vehicles that are inside an intersection already; a set bit takes this check away."""
    IGNORE_SPEED_LIMIT = 64
    """Drive faster than the lane's limit; a set bit takes this check away."""

    UNCHECKED = IGNORE_FOES_INSIDE
    """SUMO drives the commanded speed exactly."""
    SUMO = SAFE_SPEED | MAX_ACCELERATION | MAX_DECELERATION | RIGHT_OF_WAY | RED_LIGHT
    """SUMO's own default: all checks are made."""


class LaneChangeMode(IntFlag):
    """For which reasons SUMO changes lane by itself, and what it takes care of when a command asks for it.

    Two bits for each reason: 1 is to change unless a command says otherwise, 2 (not named here) to change even then.
    """

    STRATEGIC = 1 << 0
    """To stay on the route."""
    COOPERATIVE = 1 << 2
    """To let another vehicle in."""
    SPEED_GAIN = 1 << 4
    """To drive faster."""
    KEEP_RIGHT = 1 << 6
    """To keep to the right."""
    AVOID_COLLISION = 1 << 8
    """A commanded change waits where it would hit another vehicle at once."""
    RESPECT_GAPS = 1 << 9
    """A commanded change waits for safe gaps, and the speed is adapted to reach one."""
    SUBLANE = 1 << 10
    """To move within the lane, with sublanes."""

    NONE = 0
    """No change but commanded ones, which are made at once."""
    SUMO = STRATEGIC | COOPERATIVE | SPEED_GAIN | KEEP_RIGHT | RESPECT_GAPS | SUBLANE
    """SUMO's own default."""

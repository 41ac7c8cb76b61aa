"""Meetings: a host and a merging car that may come to merge beside it, and what was recorded of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.core.units import FloatArray
from merge_cosim.simulation.worlds.actors import Actor

MARGIN = 0.1
"""A car that is past the usual merging point and has not merged is taken to merge this far ahead of it [m]."""
STANDING = 0.1
"""Below this speed a merging car counts as stopped [m/s]."""


@dataclass(frozen=True)
class Attention:
    """Which merging cars a host attends to.

    Attributes:
        upstream: Both are no further than this before the ramp's merging point [m].
        apart: Neither is further than this from the other, front to front [m].
    """

    upstream: NonNegativeFloat = 150.0
    apart: PositiveFloat = 80.0


DEFAULT_ATTENTION = Attention()


class Ending(Enum):
    """How a meeting ended."""

    OPEN = "open"
    SCORED = "scored"
    """The car merged next to the host, and the horizon was seen."""
    CENSORED = "censored"
    """The car merged next to the host; then one of them left the host lane or the net."""
    NOT_NEXT = "not next"
    """Another car was between them when it merged, or it did not merge beside this host at all."""


@dataclass(eq=False)
class Meeting:
    """A host and a merging car, from when the host attends to it.

    Attributes:
        host, merging: The two.
        begin: Cycle of the scene in which it began.
        states: `RECORDED`, one array per cycle.
        merged_at: Index into `states` of the first cycle in the host lane; -1 before.
        merge_position: x of the lane change [m past the gore].
        both_at: Index of the first cycle in which both are past it; -1 before.
        stopped: The merging car stood before it could merge.
        ending: How it ended.
    """

    host: Actor
    merging: Actor
    begin: int
    states: list[FloatArray] = field(default_factory=list)
    merged_at: int = -1
    merge_position: float = 0.0
    both_at: int = -1
    stopped: bool = False
    ending: Ending = Ending.OPEN

    def merging_point(self, usual: float) -> float:
        """Where the car merges, as far as one can know [m past the gore]; `usual` is where cars merge on this ramp."""
        if self.merged_at >= 0:
            return self.merge_position
        return max(usual, self.merging.x + MARGIN)

    def record(
        self, log_odds: float, leader_gap: float, leader_speed: float, follower_gap: float, contact: bool
    ) -> None:
        """Keep one cycle."""
        state = (self.host.x, self.host.speed, self.merging.x, self.merging.speed)
        self.states.append(np.array([*state, log_odds, leader_gap, leader_speed, follower_gap, contact]))
        self.stopped |= self.merged_at < 0 and self.merging.speed < STANDING


RECORDED = (
    *("host_x", "host_speed", "merging_x", "merging_speed"),
    *("log_odds", "leader_gap", "leader_speed", "follower_gap", "contact"),
)
"""What is recorded of a meeting in every cycle; gaps are bumper to bumper, inf without a car [m, m/s]."""

"""Meetings: a host and a merging car that may come to merge beside it, and what was recorded of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from merge_cosim.cosim.scenes.roster import Actor
from merge_cosim.units import FloatArray


@dataclass(frozen=True)
class Attention:
    """Which merging cars a host attends to.

    Attributes:
        upstream: Both are no further than this before the ramp's merging point [m].
        apart: Neither is further than this from the other, front to front [m].
    """

    upstream: float = 150.0
    apart: float = 80.0


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


@dataclass
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


RECORDED = (
    *("host_x", "host_speed", "merging_x", "merging_speed"),
    *("log_odds", "leader_gap", "leader_speed", "follower_gap", "contact"),
)
"""What is recorded of a meeting in every cycle; gaps are bumper to bumper, inf without a car [m, m/s]."""

"""Meetings in living traffic: a host and a merging car that may come to merge beside it."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import NonNegativeFloat, PositiveFloat

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


@dataclass(eq=False)
class Meeting:
    """A host and a merging car, from when the host attends to it; an encounter if the car merges next to the host.

    Attributes:
        host, merging: The two.
        slot: The slot that it has.
        begun: Cycle of the world in which it began.
        start: x and speed of the host, then of the merging car, in that cycle [m past the gore, m/s].
        merged_at: Cycle of the first state in the host lane; -1 before.
        merge_position: x of the lane change [m past the gore].
        both_at: Cycle of the first state in which both are past it; -1 before.
        stopped: The merging car stood before it could merge.
        collided: SUMO has reported a contact of the two before scoring ended.
        over: Scoring has ended.
        cut_off: It ended before its horizon had been seen, because one of the two left the host lane or the net.
    """

    host: Actor
    merging: Actor
    slot: int
    begun: int
    start: tuple[float, float, float, float]
    merged_at: int = -1
    merge_position: float = 0.0
    both_at: int = -1
    stopped: bool = False
    collided: bool = False
    over: bool = False
    cut_off: bool = False

    @property
    def name(self) -> str:
        """Names of the two."""
        return f"{self.host.name}/{self.merging.name}"

    def merging_point(self, usual: float) -> float:
        """Where the car merges, by what is known in this cycle [m past the gore]; `usual`: the ramp's merging point."""
        if self.merged_at >= 0:
            return self.merge_position
        return max(usual, self.merging.x + MARGIN)

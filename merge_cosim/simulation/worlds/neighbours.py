"""The cars ahead of a host and behind it in its lane, where cars that follow a log may drive through it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from merge_cosim.core.units import TOLERANCE

SIGHT = 150.0
"""How far a host sees its leader and its follower in its lane [m]."""


class InLane(NamedTuple):
    """A car in the host's lane.

    Attributes:
        name: Its name.
        x: Its front bumper [m past the gore].
        length: Its length [m].
    """

    name: str
    x: float
    length: float


class Neighbours:
    """Watches the nearest cars ahead and behind, cycle by cycle.

    A car on its log does not see the host. One that comes to overlap it from behind, or from the side, has driven into
    it; from then on the host takes no notice of it. One that overlaps it after having been its leader was struck by the
    host; it stays the leader as long as its front is ahead, and is no follower afterwards.

    Attributes:
        leader: Name of the nearest car ahead; empty without one.
        leader_gap: Gap to it, bumper to bumper [m]; inf without one.
        follower_gap: Gap to the nearest car behind [m]; inf without one. It is negative in the cycle in which that car
            has driven into the host.
        through: Names of the cars that have driven into the host, in that order.
        struck: Names of the cars that the host has driven into.
    """

    def __init__(self, host_length: float, sight: float) -> None:
        """Watch around a host.

        Args:
            host_length: Its length [m].
            sight: How far a gap is seen [m].
        """
        self._length, self._sight = host_length, sight
        self.leader = ""
        self.leader_gap = self.follower_gap = math.inf
        self.through: list[str] = []
        self.struck: set[str] = set()

    def look(self, x: float, others: Iterable[InLane]) -> None:
        """Take in one cycle: the host's front bumper [m past the gore] and all other cars of its lane."""
        rear, led_by = x - self._length, self.leader
        self.leader, self.leader_gap, self.follower_gap = "", self._sight, self._sight
        for car in others:
            if car.name in self.through:
                continue
            is_ahead, gap_ahead, gap_behind = car.x >= x, car.x - car.length - x, rear - car.x
            overlaps = max(gap_ahead, gap_behind) < -TOLERANCE
            if overlaps and car.name not in self.struck:
                if car.name == led_by:
                    self.struck.add(car.name)
                else:
                    self.through.append(car.name)
            if is_ahead and car.name not in self.through and gap_ahead < self.leader_gap:
                self.leader, self.leader_gap = car.name, gap_ahead
            elif not is_ahead and car.name not in self.struck:
                self.follower_gap = min(self.follower_gap, gap_behind)
        if not self.leader:
            self.leader_gap = math.inf
        if self.follower_gap >= self._sight:
            self.follower_gap = math.inf

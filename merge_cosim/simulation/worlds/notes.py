"""Events of a scene that the user should know of: one line each, and counted."""

from __future__ import annotations

from collections import Counter
from enum import StrEnum


class Event(StrEnum):
    """What is noted."""

    NO_HOST = "without_host"
    NO_MERGING = "without_merging"
    NOT_DEPARTED = "vehicles_not_departed"
    HOST_NOT_DEPARTED = "hosts_not_departed"
    HOST_OFF_LANE = "hosts_off_lane"
    TWO_HOSTS = "two_hosts"
    TELEPORT = "teleports"
    HOST_CONTACT = "host_contacts"
    OTHER_CONTACT = "other_contacts"


class Notes:
    """Keeps one line per event and thing that it happened to; the same again is the same event.

    Attributes:
        lines: Each with its event, in their order.
    """

    def __init__(self) -> None:
        self.lines: list[tuple[Event, str]] = []
        self._seen: set[tuple[Event, str]] = set()
        self._count: Counter[Event] = Counter()

    def add(self, event: Event, who: str, line: str) -> None:
        """Note an event, once per `who`."""
        if (event, who) in self._seen:
            return
        self._seen.add((event, who))
        self._count[event] += 1
        self.lines.append((event, line))

    def counts(self) -> dict[str, int]:
        """How many of each event, zeros included."""
        return {str(event): self._count[event] for event in Event}

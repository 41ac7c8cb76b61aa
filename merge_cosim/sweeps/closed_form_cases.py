"""Pairs that the closed form moves instead of SUMO: thousands of encounters side by side."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import ClassVar

from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.sweeps.cases import Opened, PairCases, RunOptions, no_facts
from merge_cosim.sweeps.worker_session import WorkerSession

CHUNK_CASES = 4_096
"""Most encounters that are handed out at a time, all side by side: fewer of them spread numpy's cost per call less
well, more of them fit the cache less well."""


@dataclass(frozen=True)
class ClosedFormCases(PairCases):
    """Encounters of a host and a merging car alone, without SUMO."""

    world: ClassVar[WorldKind] = "closed-form"
    most: ClassVar[int] = CHUNK_CASES

    @contextmanager
    def _opened(
        self, ramp: Ramp, seed: int, worker_session: WorkerSession, options: RunOptions, human: bool
    ) -> Iterator[Opened]:
        if human:
            with super()._opened(ramp, seed, worker_session, options, human) as opened:
                yield opened
        else:
            yield Opened(ClosedFormWorld(len(self)), seed, no_facts)

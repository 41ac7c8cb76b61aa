"""Pairs that the closed form moves instead of SUMO: thousands of encounters side by side."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.tracks import RECORDED
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.sweeps.cases import Opened, PairCases, RunOptions, no_facts
from merge_cosim.sweeps.worker_session import WorkerSession

CHUNK_CASES = 4_096
"""Most encounters that are handed out at a time, all side by side: fewer of them spread numpy's cost per call less
well, more of them fit the cache less well."""


RECORD_BYTES = 1 << 28
"""Most memory of the record of the encounters that run side by side."""


@dataclass(frozen=True)
class ClosedFormCases(PairCases):
    """Encounters of a host and a merging car without other cars, in the closed form.

    Attributes:
        side_by_side: Most of them that run at a time.
    """

    side_by_side: int = field(default=CHUNK_CASES, kw_only=True)
    world: ClassVar[WorldKind] = "closed-form"
    most: ClassVar[int] = CHUNK_CASES

    @contextmanager
    def _opened(self, ramp: Ramp, seed: int, worker_session: WorkerSession, options: RunOptions) -> Iterator[Opened]:
        yield Opened(ClosedFormWorld(min(len(self), self.side_by_side)), seed, no_facts)


def side_by_side(rules: Rules) -> int:
    """How many encounters can be recorded at a time, each of which may last until it times out."""
    return max(1, RECORD_BYTES // (RECORDED * np.dtype(float).itemsize * (rules.time_out_cycles + 1)))

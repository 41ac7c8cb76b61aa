"""The logged host against the logged merging car: the logged cars did not collide, so a replay must not either.

It also finds how far each log suffices: to the end of scoring, to a lane change that ends it early, or not so far, in
which case a replay continues the log at constant speed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.units import DT, MIN_SPEED, TOLERANCE, BoolArray, FloatArray
from merge_cosim.ngsim.pairing.pairs import Paired
from merge_cosim.ngsim.pairing.rules import cycles

HORIZON = 3.0
"""Time [s] that is scored from the first cycle with both cars past the merging point."""


@dataclass(frozen=True)
class LoggedOutcome:
    """The outcome of each encounter with the logged host; every array has shape (n,).

    Attributes:
        failed: The bodies overlap by more than the tolerance while scored.
        cut: Scoring ends early, because a logged car leaves the host lane.
        extended: A log ends before scoring does and is continued at constant speed.
    """

    failed: BoolArray
    cut: BoolArray
    extended: BoolArray

    @property
    def complete(self) -> BoolArray:
        """The logs are long enough for all of the scoring."""
        return ~self.cut & ~self.extended


def replay_logged_host(encounters: Encounters, horizon: float = HORIZON) -> LoggedOutcome:
    """Score the logged host of each encounter: from the first cycle with both stations >= 0 for `horizon` [s].

    A log that ends in the host lane goes on at its last speed, as in any replay (`MIN_SPEED` at least, so that a car
    that stands in traffic is scored, too).
    """
    log = encounters.log
    if log is None:
        raise ValueError("these encounters have no log")
    outcome = LoggedOutcome(*(np.zeros(len(encounters), dtype=bool) for _ in range(3)))
    for row in range(len(encounters)):
        merging, host = log.merging_station[row], log.host_station[row]
        first = max(_arrival(merging), _arrival(host))
        last = min(first + cycles(horizon), int(log.score_until[row]))
        outcome.cut[row] = last < first + cycles(horizon)
        outcome.extended[row] = last >= min(len(merging), len(host))
        if last >= first:
            m, h = (_continued(track, last + 1)[first:] for track in (merging, host))
            rear = np.maximum(m - encounters.merging_length[row], h - encounters.host_length[row])
            outcome.failed[row] = np.any(np.minimum(m, h) - rear > TOLERANCE)
    return outcome


def without_failures(paired: Paired) -> Paired:
    """Move the pairs whose logged host fails from the encounters to the rejected, as `logged_host_fails`."""
    failed = replay_logged_host(paired.encounters).failed
    if not failed.any():
        return paired
    rejected = {**paired.rejected, "logged_host_fails": tuple(paired.encounters.case[failed])}
    return replace(paired, encounters=paired.encounters.take(np.flatnonzero(~failed)), rejected=rejected)


def _arrival(station: FloatArray) -> int:
    """First cycle with station >= 0, of the log or of its continuation."""
    past = station >= -TOLERANCE
    if past.any():
        return int(np.argmax(past))
    return len(station) - 1 + int(np.ceil((-TOLERANCE - station[-1]) / (_last_speed(station) * DT)))


def _last_speed(station: FloatArray) -> float:
    """Speed [m/s] that continues a log."""
    return max(float(station[-1] - station[-2]) / DT, MIN_SPEED)


def _continued(station: FloatArray, length: int) -> FloatArray:
    """The first `length` cycles of a log, continued at its last speed where it is shorter."""
    beyond = np.arange(1, max(length - len(station), 0) + 1)
    return np.concatenate([station[:length], station[-1] + beyond * _last_speed(station) * DT])

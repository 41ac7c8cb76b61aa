"""The rules by which logged cars become encounters: every threshold, in one place."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, NonNegativeFloat, model_validator

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import DT


def cycles(seconds: float) -> int:
    """Return the number of 0.1 s cycles in `seconds`."""
    return round(seconds / DT)


class PairRules(BaseModel):
    """When a host and a merging car make a pair, and how their logs are filtered.

    A site may set its own values (`[pairs]` of its `site.toml`); what a scenario sets stands above them.

    Attributes:
        max_host_distance: A host is at most this far from the merging car at the lane change, front to front [m].
        min_window: Both cars are logged for at least this long before the lane change [s].
        max_window: The window starts at most this long before the lane change [s]; None for as early as both are
            logged. For sensitivity: a later start takes the easy, far part of the approach away.
        hold: A car is in (or out of) the host lane once it stays there this long; shorter is flicker [s].
        carry_on: Where the recorded road ends soon: a host that left it counts on at its last speed for at most this
            long, so that it may still be there at the lane change [s]. 0: it must be logged.
        max_speed: A pair is rejected if either smoothed track is faster than this within the window [m/s].
        max_acceleration: A pair is rejected if either smoothed track accelerates or brakes harder [m/s^2].
        default_length: Length of a car whose length was not logged [m].
        smoothing_window: Window of the symmetric filter of positions [cycles], odd.
        smoothing_order: Order of its polynomial.
        observed: What an estimator sees of a merging car's speed: `causal`ly filtered, or `raw` as logged.
        observed_window: Window of the causal filter [cycles].
        observed_order: Order of its polynomial.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    max_host_distance: float = 60.0
    min_window: float = 2.0
    max_window: float | None = None
    hold: float = 0.5
    carry_on: NonNegativeFloat = 0.0
    max_speed: float = 40.0
    max_acceleration: float = 10.0
    default_length: float = 5.0
    smoothing_window: int = 11
    smoothing_order: int = 2
    observed: Literal["causal", "raw"] = "causal"
    observed_window: int = 11
    observed_order: int = 1

    def over(self, base: PairRules) -> PairRules:
        """Return these rules, with the values of `base` where these were not set."""
        return PairRules(**base.model_dump(exclude_unset=True) | self.model_dump(exclude_unset=True))

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.smoothing_window % 2 == 0 or self.smoothing_window <= self.smoothing_order:
            raise UserError(
                f"pair rules: smoothing_window is {self.smoothing_window}; it must be odd and greater than "
                f"smoothing_order ({self.smoothing_order})"
            )
        if self.observed_window <= self.observed_order:
            raise UserError(
                f"pair rules: observed_window is {self.observed_window}; it must be greater than observed_order "
                f"({self.observed_order})"
            )
        if self.min_window < DT or (self.max_window is not None and self.max_window < self.min_window):
            raise UserError(
                f"pair rules: min_window is {self.min_window} s and max_window {self.max_window}; windows need "
                f"0.1 s <= min_window <= max_window"
            )
        return self

"""The named cases of the papers, run again cycle by cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from merge_cosim.core.encounter import Encounters
from merge_cosim.report.methods import in_order
from merge_cosim.studies.reproduction import Study
from merge_cosim.sweeps.plan import plan
from merge_cosim.sweeps.single import trace_methods

LOGGED_METHODS = ("acc", "slot", "ipcb", "pgm-g", "pgm", "fg-gmm", "dbn-pf", "human")
"""All methods of the papers, and the human host."""
WANTED = {"host_station": -170.0, "host_speed": 9.9, "merging_station": -100.0, "merging_speed": 10.4}
"""Initial state of the published case [m, m/s] (Dong, Dolan, Litkouhi, station and speed over time)."""
NEAR = {"host_station": 20.0, "host_speed": 2.0, "merging_station": 20.0, "merging_speed": 2.0}
"""A pair farther from it than this [m, m/s] is another case."""
BEHIND_METHODS = ("ipcb", "ipcb+acc", "pgm")
BEHIND_CASE = "d+5_h20_m15"
"""Merging car behind the host but accelerating (Dong, Dolan, Litkouhi 2017, Fig. 3), a case of Designed Test II."""


@dataclass(frozen=True)
class NamedCase:
    """One case under several methods.

    Attributes:
        name: Name of the case.
        start: Its initial state, in words.
        found: It is the published one, or as near to it as `NEAR`.
        traces: Records, one row per method and cycle.
        failed: Whether it failed, by method.
    """

    name: str
    start: str
    found: bool
    traces: pd.DataFrame
    failed: dict[str, bool]

    def lowest_acceleration(self) -> dict[str, float]:
        """Hardest braking of the host before its front reaches the merging point, by method [m/s^2]."""
        before = self.traces[self.traces["host_station_m"] < 0]
        lowest = before.groupby("method")["host_acceleration_m_s2"].min()
        return {method: float(lowest[method]) for method in in_order(lowest.index)}


def published_case(study: Study) -> NamedCase:
    """The pair nearest to the published initial state, and whether it is near enough to be the same."""
    request = replace(study.request, scenarios=("us101-replay",), methods=LOGGED_METHODS)
    encounters = plan(request)[0].cases.encounters
    assert encounters is not None
    away = [np.abs(getattr(encounters, name) - value) / NEAR[name] for name, value in WANTED.items()]
    distance = np.max(away, axis=0)
    nearest = int(np.argmin(distance))
    name = str(encounters.case[nearest])
    return NamedCase(name, _start(encounters, nearest), bool(distance[nearest] <= 1.0), *trace_methods(request, name))


def behind_but_accelerating(study: Study) -> NamedCase:
    """The situation of Fig. 3: the merging car is behind the host and accelerates."""
    request = replace(study.request, scenarios=("designed-2",), methods=BEHIND_METHODS, settings={})
    encounters = plan(request)[0].cases.encounters
    assert encounters is not None
    row = int(np.flatnonzero(encounters.case == BEHIND_CASE)[0])
    return NamedCase(BEHIND_CASE, _start(encounters, row), True, *trace_methods(request, BEHIND_CASE))


def _start(encounters: Encounters, row: int) -> str:
    host, merging = (
        f"{getattr(encounters, f'{car}_station')[row]:.0f} m at {getattr(encounters, f'{car}_speed')[row]:.1f} m/s"
        for car in ("host", "merging")
    )
    return f"host {host}, merging car {merging}"

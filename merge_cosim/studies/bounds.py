"""Bounds for any host against a log: whether it can pass without a failure, and with which delay.

Feasibility: full braking keeps the smallest station in every cycle, full throttle up to the limit the largest; if both
fail, no host passes behind or ahead. It is decided by the loop and its scoring themselves, in the closed form. Smallest
delay: ahead of the merging car nothing is sooner than full throttle; behind it see `earliest`. A delay is rounded up to
the next whole cycle where the host passes behind.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import Controller
from merge_cosim.controllers.brake import Brake
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import DT, TOLERANCE, AnyArray, BoolArray, FloatArray
from merge_cosim.estimators.references import AlwaysYield
from merge_cosim.merging_cars.replay import Replay
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.rows import free_time
from merge_cosim.scenarios.encounters import SourceChoice, load_encounters
from merge_cosim.scenarios.scenario import Scenario, load_scenario
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.scoring import GOAL
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import simulate
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.studies.minimum_delay import Ahead, Reach, earliest_pass_behind

MOST_DELAY = 5.0
"""Delay [s] beyond which a case counts as infeasible in the second bound."""


@dataclass(kw_only=True)
class Throttle(Controller):
    """Accelerates fully up to the speed limit and never brakes: the largest station in every cycle."""

    name: ClassVar[str] = "throttle"
    max_acceleration: float = 2.0

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """Full acceleration, cut so as to end at the limit."""
        wanted = (self.setting.speed_limit - seen.host_speed) / self.setting.dt
        return np.clip(wanted, 0.0, self.max_acceleration)


def bounds_of(
    name: str, settings: dict[str, Any], data: Path | None, source: SourceChoice | None
) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Bounds of a replay scenario by its name or file: case by case, and counted per site and source.

    Raises:
        UserError: It is no replay, or its data are absent.
    """
    scenario = load_scenario(name, settings)
    cases = bounds(scenario, load_encounters(scenario, data, source))
    return cases, summarise_bounds(cases)


def summarise_bounds(cases: pd.DataFrame) -> list[dict[str, Any]]:
    """Counts per scenario, site and source: cases, infeasible ones, and those infeasible within `MOST_DELAY`."""
    rows = []
    for (scenario, site, source), group in cases.groupby(["scenario", "site", "source"]):
        n, late = len(group), int(group["infeasible_in_time"].sum())
        infeasible = int((~group["feasible"]).sum())
        rows.append(
            {
                "scenario": scenario,
                "site": site,
                "source": source,
                "n": n,
                "infeasible": infeasible,
                "infeasible_pct": round(100 * infeasible / n, 4),
                "most_delay_s": MOST_DELAY,
                "infeasible_in_time": late,
                "infeasible_in_time_pct": round(100 * late / n, 4),
                "min_delay_s": round(float(group["min_delay_s"].mean()), 4),
            }
        )
    return rows


def bounds(scenario: Scenario, encounters: Encounters) -> pd.DataFrame:
    """Bound what a host can reach in each case of a replay.

    Args:
        scenario: A replay.
        encounters: Its cases.

    Returns:
        One row per case: `scenario`, `site`, `source`, `case`; `feasible`, `by_braking`, `by_throttle`; `min_delay_s`,
        NaN where there is no way, and `infeasible_in_time`, that there is none or it is above `MOST_DELAY`.

    Raises:
        UserError: The scenario is no replay, or is not scored from both cars' arrival on.
    """
    if encounters.log is None or not scenario.is_replay:
        raise UserError(f"scenario {scenario.name}: bounds are against a log; choose a replay scenario")
    if scenario.test.overlap_from != "both":
        raise UserError(f'scenario {scenario.name}: bounds need test.overlap_from = "both"')
    setting = Setting(speed_limit=scenario.speed_limit or Ramp.load(scenario.ramp).speed_limit)
    law = Acc()
    throttle = _drive(Throttle(max_acceleration=law.max_acceleration), encounters, scenario.test, setting)
    brake = _drive(Brake(min_acceleration=law.min_acceleration), encounters, scenario.test, setting)
    by_throttle, by_braking = throttle["kind"] == 0, brake["kind"] == 0
    at_once = Acc(k_free=1.0 / setting.dt)  # free driving so stiff that it is full throttle
    fastest = free_time(encounters.host_station, encounters.host_speed, setting, at_once)
    earliest = np.where(by_throttle, fastest, np.inf)
    reach = Reach(setting.speed_limit, law.min_acceleration, law.max_acceleration)
    for row in range(len(encounters)):
        ahead = Ahead.of(encounters, row, scenario.test)
        station, speed = float(encounters.host_station[row]), float(encounters.host_speed[row])
        if not by_throttle[row] and station < -TOLERANCE:
            earliest[row] = earliest_pass_behind(ahead, station, speed, GOAL, reach)
    delay = earliest - free_time(encounters.host_station, encounters.host_speed, setting, scenario.test.free)
    return pd.DataFrame(
        {
            "scenario": scenario.name,
            "site": encounters.site,
            "source": encounters.source,
            "case": encounters.case,
            "feasible": by_throttle | by_braking,
            "by_braking": by_braking,
            "by_throttle": by_throttle,
            "min_delay_s": np.where(np.isfinite(delay), np.round(delay, 4), np.nan),
            "infeasible_in_time": ~(delay <= MOST_DELAY + DT * TOLERANCE),
        }
    )


def _drive(controller: Controller, encounters: Encounters, rules: Rules, setting: Setting) -> dict[str, AnyArray]:
    driver = HostDriver(AlwaysYield(), controller)
    return simulate(ClosedFormWorld(len(encounters)), encounters, driver, Replay(), rules, setting).columns

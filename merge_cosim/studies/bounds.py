"""Bounds for any host: whether it can pass without a failure, and with which delay.

Against a log: full braking keeps the smallest station in every cycle, full throttle up to the limit the largest; if
both fail, no host passes behind or ahead. It is decided by the loop and its scoring themselves, in the closed form.
Smallest delay: ahead of the merging car full throttle is the fastest; behind it see `minimum_delay`. A delay is
rounded up to the next whole cycle where the host passes behind.

Against a driver who reacts, only the paths found are known to be possible (`clairvoyant`), and full throttle bounds the
delay from below. The same search against a log shows how much it misses.
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
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.rows import delay, free_time
from merge_cosim.scenarios.encounters import SourceChoice, load_encounters
from merge_cosim.scenarios.scenario import Scenario, load_scenario
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.scoring import GOAL
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld
from merge_cosim.studies.clairvoyant import Search, search_plans
from merge_cosim.studies.minimum_delay import Ahead, Reach, earliest_pass_behind

FINE = Search()
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
    name: str,
    settings: dict[str, Any],
    data: Path | None,
    source: SourceChoice | None,
    search: Search | None = FINE,
) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Bounds of a scenario of two cars by its name or file: case by case, and counted per site and source.

    Raises:
        UserError: It has more cars than two, or its data are absent.
    """
    scenario = load_scenario(name, settings)
    _check(scenario)
    cases = bounds(scenario, load_encounters(scenario, data, source), search)
    return cases, summarise_bounds(cases)


def summarise_bounds(cases: pd.DataFrame) -> list[dict[str, Any]]:
    """Counts per scenario, site and source: cases, infeasible ones, those infeasible within `MOST_DELAY`, delays."""
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
                "found_delay_s": round(float(group["found_delay_s"].mean()), 4),
                "gap_s": round(float((group["found_delay_s"] - group["min_delay_s"]).mean()), 4),
            }
        )
    return rows


def bounds(scenario: Scenario, encounters: Encounters, search: Search | None = FINE) -> pd.DataFrame:
    """Bound what a host can reach in each case.

    Args:
        scenario: A scenario of two cars, without traffic.
        encounters: Its cases.
        search: How finely paths are searched; None for full throttle only, which is enough against a log.

    Returns:
        One row per case: `scenario`, `site`, `source`, `case`; `by_throttle`, `by_braking`, and `feasible`, that one of
        them or the path found does not fail; `min_delay_s`, a lower bound of any delay, NaN where no host passes;
        `found_delay_s`, that of the path found, NaN without one; `infeasible_in_time`, that the smallest delay is above
        `MOST_DELAY`: against a log `min_delay_s`, against a driver who reacts `found_delay_s`.

    Raises:
        UserError: There are more cars than two, or scoring does not begin with both cars' arrival.
    """
    _check(scenario)
    if scenario.is_replay and encounters.log is None:
        raise UserError(f'scenario {scenario.name}: it needs logged encounters; use kind = "pairs"')
    rules, merging_car, law = scenario.test, scenario.merging_car(), Acc()
    setting = Setting(speed_limit=scenario.speed_limit or Ramp.load(scenario.ramp).speed_limit)

    def drive(driver: HostDriver) -> dict[str, AnyArray]:
        return Loop(ClosedFormWorld(len(encounters)), encounters, driver, merging_car, rules, setting).run().columns

    throttle = drive(HostDriver(AlwaysYield(), Throttle(max_acceleration=law.max_acceleration)))
    brake = drive(HostDriver(AlwaysYield(), Brake(min_acceleration=law.min_acceleration)))
    by_throttle, by_braking = throttle["kind"] == 0, brake["kind"] == 0
    at_once = Acc(k_free=1.0 / setting.dt)  # free driving so stiff that it is full throttle
    earliest = free_time(encounters.host_station, encounters.host_speed, setting, at_once)
    if scenario.is_replay:
        reach = Reach(setting.speed_limit, law.min_acceleration, law.max_acceleration)
        for row in np.flatnonzero(~by_throttle):
            earliest[row] = _behind(encounters, int(row), rules, reach)
    wanted = np.flatnonzero(~by_throttle & (search is not None))
    plans = search_plans(encounters, merging_car, rules, setting, search or FINE, wanted)
    driven = drive(plans.driver(encounters))
    found = driven["kind"] == 0
    smallest = earliest - free_time(encounters.host_station, encounters.host_speed, setting, rules.free)
    reached = np.where(found, delay(driven, encounters, setting, rules.free), np.inf)
    return pd.DataFrame(
        {
            "scenario": scenario.name,
            "site": encounters.site,
            "source": encounters.source,
            "case": encounters.case,
            "feasible": by_throttle | by_braking | found,
            "by_braking": by_braking,
            "by_throttle": by_throttle,
            "min_delay_s": _rounded(smallest),
            "found_delay_s": _rounded(reached),
            "infeasible_in_time": ~((smallest if scenario.is_replay else reached) <= MOST_DELAY + DT * TOLERANCE),
        }
    )


def _check(scenario: Scenario) -> None:
    if scenario.is_scene or scenario.full_scene is not None:
        raise UserError(f"scenario {scenario.name}: bounds are for two cars alone, without traffic or full_scene")
    if scenario.test.overlap_from != "both":
        raise UserError(f'scenario {scenario.name}: bounds need test.overlap_from = "both"')


def _behind(encounters: Encounters, row: int, rules: Rules, reach: Reach) -> float:
    station, speed = float(encounters.host_station[row]), float(encounters.host_speed[row])
    if station >= -TOLERANCE:
        return float("inf")
    return earliest_pass_behind(Ahead.of(encounters, row, rules), station, speed, GOAL, reach)


def _rounded(delays: FloatArray) -> FloatArray:
    return np.where(np.isfinite(delays), np.round(delays, 4), np.nan)

"""From the measures of a run to result rows: one per (scenario, case, method), in the columns of `schema`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pyarrow as pa

from merge_cosim.controllers.law import FreeDriving
from merge_cosim.core.encounter import NEVER, Encounters, Intention
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import MIN_SPEED, AnyArray, BoolArray, FloatArray, time_to_arrival
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.results.schema import SCHEMA
from merge_cosim.scoring.decisions import GATES
from merge_cosim.scoring.scoring import GOAL, KINDS
from merge_cosim.scoring.surroundings import MEASURES
from merge_cosim.simulation.loop import Run


def result_rows(
    run: Run,
    encounters: Encounters,
    setting: Setting,
    free_law: FreeDriving,
    names: dict[str, str],
    model: IntentionModel | None = None,
) -> pa.Table:
    """Return the result rows of a run.

    Args:
        run: The run.
        encounters: Its n cases.
        setting: Speed limit and cycle.
        free_law: The free driving that the delay is measured against.
        names: `scenario`, `variation`, `method` and `model` of all rows.
        model: The learned model of the method, if it has one.
    """
    c, n, dt = run.columns, len(encounters), setting.dt
    failed = c["kind"] > 0
    labelled = encounters.label >= 0
    decided = c["last_decision"] >= 0
    correct = labelled & decided & (c["last_decision"] == encounters.label)
    host_first = c["host_reached_s"] < np.nan_to_num(c["merging_reached_s"], nan=np.inf)
    order_known = ~(np.isnan(c["host_reached_s"]) & np.isnan(c["merging_reached_s"]))
    if encounters.log is None:
        last_logged = np.full(n, NEVER)
        score_until = np.full(n, NEVER)
    else:
        last_logged = encounters.log.merging_station.lengths - 1
        score_until = encounters.log.score_until
    unfinished = ~failed & ~c["scored_to_end"]
    censored = unfinished & c.get("cut_off", (c["end_cycle"] >= score_until) | (c["scored_from"] >= 0))
    reached = ~np.isnan(c["host_reached_s"]) | (encounters.host_station >= 0)
    stuck = unfinished & ~reached & ~censored
    waiting = (c["end_merging_station"] < 0) & (np.maximum(c["end_speed"], c["end_merging_speed"]) < MIN_SPEED)
    columns: dict[str, AnyArray | pa.Array] = {
        "site": encounters.site,
        "source": encounters.source,
        "case": encounters.case,
        "car": encounters.car,
        "host_station_0_m": encounters.host_station,
        "host_speed_0": encounters.host_speed,
        "merging_station_0_m": encounters.merging_station,
        "merging_speed_0": encounters.merging_speed,
        "failed": failed,
        "failure_kind": np.array(KINDS)[c["kind"].astype(np.int64)],
        "stuck": stuck,
        "deadlock": stuck & waiting,
        "in_support": _supported(model, encounters),
        "censored": censored,
        "extended": c["end_cycle"] > last_logged,
        "smoothed_source": encounters.smoothed_source,
        "host_reached": reached,
        "host_first": _masked(host_first, order_known),
        "order_swapped": _masked(host_first != (encounters.label == Intention.YIELD), order_known & labelled),
        "label": np.array(["YIELD", "NOT_YIELD", ""])[encounters.label],
        "correct_at_merge": _masked(correct, labelled & decided),
        "decision_flips": pa.array(c["decision_flips"], pa.int32(), mask=~decided),
        "distance_m": _finite(c["distance_m"]),
        "gap_m": _finite(c["gap_m"]),
        "min_gap_m": _finite(c["min_gap_m"]),
        "min_ttc_s": _finite(c["min_ttc_s"]),
        "max_drac": _masked(c["max_drac"], c["max_drac"] > 0),
        "pet_s": _finite(post_encroachment(c, encounters, dt)),
        "delay_s": delay(c, encounters, setting, free_law),
        "hardest_braking": c["hardest_braking"],
        "mean_jerk": _ratio(c["jerk_sum"] / dt, c["end_cycle"] - 1),
        "first_stable_s": _masked(c["decided_from"] * dt, correct),
        **{f"log_odds_{gate}": _known(c[f"log_odds_{gate}"]) for gate in GATES},
        **{f"arrival_lead_{gate}": _known(c[f"arrival_lead_{gate}"]) for gate in GATES},
        **_human_difference(c, encounters),
        "host_reached_s": _finite(c["host_reached_s"]),
        "merging_reached_s": _finite(c["merging_reached_s"]),
        "end_s": c["end_cycle"] * dt,
        "ambiguity_s": np.abs(
            time_to_arrival(encounters.merging_station, encounters.merging_speed)
            - time_to_arrival(encounters.host_station, encounters.host_speed)
        ),
        "sumo_collision": c["sumo_collision"].astype(bool),
        **{name: _finite(c[name]) for name in MEASURES if name in c},
        **{name: c[name] for name in ("merging_stopped",) if name in c},
    }
    constant = {**names, "world": run.world}
    arrays = []
    for column in SCHEMA:
        if column.name in constant:
            arrays.append(pa.array([constant[column.name]] * n, column.type))
        elif column.name not in columns:
            arrays.append(pa.nulls(n, column.type))
        elif isinstance(columns[column.name], pa.Array):
            arrays.append(columns[column.name])
        else:
            arrays.append(pa.array(columns[column.name], column.type))
    return pa.Table.from_arrays(arrays, schema=SCHEMA)


def free_time(station: FloatArray, speed: FloatArray, setting: Setting, law: FreeDriving) -> FloatArray:
    """Time [s] to reach station `GOAL` by free driving in steps of dt, the crossing interpolated; 0 if past it."""
    station, speed = station.copy(), speed.copy()
    time = np.zeros(len(station))
    under_way = station < GOAL
    while under_way.any():
        faster = np.maximum(speed + law.clip(law.free(speed, setting.speed_limit)) * setting.dt, 0.0)
        speed = np.where(under_way, faster, speed)
        step = speed * setting.dt
        part = np.clip(np.divide(GOAL - station, step, out=np.ones_like(step), where=step > 0), 0.0, 1.0)
        time += np.where(under_way, part * setting.dt, 0.0)
        station = np.where(under_way, station + step, station)
        under_way = station < GOAL
    return time


def delay(c: Mapping[str, AnyArray], encounters: Encounters, setting: Setting, law: FreeDriving) -> FloatArray:
    """Delay [s] of each host, from the measures of a run: its time to station `GOAL` less that of free driving."""
    rest = free_time(c["end_station"], c["end_speed"], setting, law)
    arrival: FloatArray = np.where(np.isnan(c["goal_s"]), c["end_cycle"] * setting.dt + rest, c["goal_s"])
    return arrival - free_time(encounters.host_station, encounters.host_speed, setting, law)


def _supported(model: IntentionModel | None, encounters: Encounters) -> pa.Array:
    if model is None:
        return pa.nulls(len(encounters), pa.bool_())
    merging = time_to_arrival(encounters.merging_station, encounters.merging_speed)
    host = time_to_arrival(encounters.host_station, encounters.host_speed)
    return pa.array(model.arrivals.supports(merging, host))


def post_encroachment(c: Mapping[str, AnyArray], encounters: Encounters, dt: float) -> FloatArray:
    """Post-encroachment time [s]: from the first car's rear clearing the merging point to the second's front there.

    Where the run ended before the rear had passed, the first car goes on at its last speed, which makes the time
    negative. NaN where a front never arrives, or the first car had passed at the start, or stands on the point.
    """
    host = np.where(encounters.host_station >= 0, -np.inf, c["host_reached_s"])
    merging = np.where(encounters.merging_station >= 0, -np.inf, c["merging_reached_s"])
    host_second = host >= merging
    cleared = np.where(host_second, c["merging_cleared_s"], c["host_cleared_s"])
    rear = np.where(
        host_second,
        c["end_merging_station"] - encounters.merging_length,
        c["end_station"] - encounters.host_length,
    )
    speed = np.where(host_second, c["end_merging_speed"], c["end_speed"])
    left = np.divide(-rear, speed, out=np.full(len(rear), np.nan), where=(speed > 0) & (rear < 0))
    cleared = np.where(np.isnan(cleared), c["end_cycle"] * dt + left, cleared)
    return np.where(np.isnan(host + merging), np.nan, np.maximum(host, merging) - cleared)


def _human_difference(c: Mapping[str, AnyArray], encounters: Encounters) -> dict[str, pa.Array]:
    """Root mean square differences to the logged host over the cycles that both drive."""
    last = np.zeros(len(encounters)) if encounters.log is None else encounters.log.host_station.lengths - 1
    joint = np.minimum(c["end_cycle"], last)
    squares = {"human_station_rms_m": c["station_square_sum"], "human_speed_rms": c["speed_square_sum"]}
    return {name: _ratio(total, joint, root=True) for name, total in squares.items()}


def _ratio(total: FloatArray, count: AnyArray, root: bool = False) -> pa.Array:
    mean = total / np.maximum(count, 1)
    return _masked(np.sqrt(mean) if root else mean, count > 0)


def _masked(values: AnyArray, known: BoolArray) -> pa.Array:
    return pa.array(values, mask=~known)


def _known(values: FloatArray) -> pa.Array:
    return pa.array(values, pa.float64(), mask=np.isnan(values))


def _finite(values: FloatArray) -> pa.Array:
    return pa.array(values, pa.float64(), mask=~np.isfinite(values))

"""One encounter at a time in plain Python: what the loops of this folder share.

This is the program that one would write first: for each case two cars are added to SUMO, and every 0.1 s they are read,
both speeds are decided and set, until the case is scored. The decisions are those of the method `acc` against the
designed merging car, and the scoring is that of the toolkit; `merge-cosim bench` checks that the outcomes agree.

The task is a JSON file written by `merge-cosim bench`: the net, the routes, the cases, and the parameters of the laws.
"""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace
from typing import Any

DT = 0.1
TOLERANCE = 1e-6


def sumo_options(task: Any) -> list[str]:
    """Options that every loop starts SUMO with."""
    options = {
        "--net-file": task.net,
        "--step-length": DT,
        "--no-internal-links": "true",
        "--time-to-teleport": -1,
        "--collision.action": "none",
        "--no-step-log": "true",
        "--no-warnings": "true",
        "--xml-validation": "never",
    }
    return [str(word) for pair in options.items() for word in pair]


def add_routes(api: Any, task: Any) -> None:
    """Define the two routes."""
    api.route.add("main", task.main_route)
    api.route.add("ramp", task.ramp_route)


def drive(api: Any, task: Any, case: Any) -> tuple[bool, int]:
    """Run one case; returns whether it failed, and its vehicles times steps."""
    vehicle = api.vehicle
    for name, route, station, speed in (
        ("host", "main", case.host_station, case.host_speed),
        ("merging", "ramp", case.merging_station, case.merging_speed),
    ):
        position = str(task.road_length + station)
        vehicle.add(name, route, departPos=position, departSpeed=str(speed), departLane="0")
        vehicle.setLength(name, task.length)
        vehicle.setSpeedMode(name, 32)
        vehicle.setLaneChangeMode(name, 0)
    api.simulationStep()  # the cars appear, and do not move yet
    host, merging = case.host_station, case.merging_station
    host_speed, merging_speed = case.host_speed, case.merging_speed
    failed, cycle, scored_from = False, 0, None
    while True:
        vehicle.setSpeed("host", next_host_speed(task, host, host_speed, merging, merging_speed))
        vehicle.setSpeed("merging", next_merging_speed(task, host, host_speed, merging, merging_speed))
        api.simulationStep()
        cycle += 1
        host = round(case.host_station + vehicle.getDistance("host"), 6)
        merging = round(case.merging_station + vehicle.getDistance("merging"), 6)
        host_speed, merging_speed = round(vehicle.getSpeed("host"), 6), round(vehicle.getSpeed("merging"), 6)
        if scored_from is None and min(host, merging) >= -TOLERANCE:
            scored_from = cycle
        if scored_from is not None:
            failed = abs(merging - host) - task.length < -TOLERANCE
        if failed or cycle >= task.time_out or (scored_from is not None and cycle >= scored_from + task.horizon):
            break
    vehicle.remove("host")
    vehicle.remove("merging")
    return failed, 2 * cycle


def next_host_speed(task: Any, host: float, host_speed: float, merging: float, merging_speed: float) -> float:
    """The merging car is the target if it is not behind; then distance keeping, else free driving."""
    law = task.host_law
    free = law.k_free * (task.speed_limit - host_speed)
    wanted = free
    if merging - host >= -TOLERANCE:
        gap = merging - task.length - host
        keep = law.k_gap * (gap - (law.d0 + law.headway * host_speed)) + law.k_speed * (merging_speed - host_speed)
        wanted = min(keep, free)
    return max(host_speed + min(max(wanted, law.min_acceleration), law.max_acceleration) * DT, 0.0)


def next_merging_speed(task: Any, host: float, host_speed: float, merging: float, merging_speed: float) -> float:
    """Distance keeping to a host that is clear ahead, else free driving."""
    law = task.merging_law
    free = law.k_free * (task.speed_limit - merging_speed)
    wanted = free
    gap = host - merging - task.length
    if gap > TOLERANCE:
        keep = law.k_gap * (gap - (law.d0 + law.headway * merging_speed)) + law.k_speed * (host_speed - merging_speed)
        wanted = min(keep, free)
    return max(merging_speed + min(max(wanted, law.min_acceleration), law.max_acceleration) * DT, 0.0)


def main(run: Callable[[Any, list[Any]], tuple[list[tuple[bool, int]], float]]) -> None:
    """Read the task, run its cases, print the outcomes and the time as JSON.

    Args:
        run: Takes the task and its cases; returns each case's outcome, and a time [s] that is not to be counted.
    """
    task = json.loads(Path(sys.argv[1]).read_text(), object_hook=lambda values: SimpleNamespace(**values))
    begin, cpu = perf_counter(), _cpu()
    outcomes, waited = run(task, task.cases)
    wall = perf_counter() - begin - waited
    failed, steps = [one for one, _ in outcomes], sum(steps for _, steps in outcomes)
    print(json.dumps({"failed": failed, "vehicle_steps": steps, "wall_s": wall, "cpu_s": _cpu() - cpu}))


def _cpu() -> float:
    """Processor time [s] of this process and of those that it has waited for, such as a sumo of its own."""
    return sum(os.times()[:4])

"""How many runs a sweep is, and about how long it will take: printed before it begins."""

from __future__ import annotations

from collections.abc import Sequence

from merge_cosim.scenarios.sources import Traffic
from merge_cosim.sweeps.cases import LoggedCases
from merge_cosim.sweeps.chunks import cut
from merge_cosim.sweeps.task import Task

PAIR_US = {"sumo": 11.0, "closed-form": 0.8}
"""Processor time of one encounter and cycle, by world, with a usual estimator [us]."""
SLOW_US = {"rollout": 9.0}
"""What some planners add to it [us]."""
LOGGED_US = 500.0
"""The same among logged cars, which are placed one by one [us]."""
CAR_US = 7.5
"""Processor time of one car and step of living traffic [us]."""
PASSAGE_S, USUAL_CARS = 70.0, 50.0
"""Time that a car of generated traffic is on the ramp's net [s], and cars on it where a route file makes them."""
MINUTE = 60.0
LONG_S = 10.0
"""What there is to run is printed where it takes about this long [s] or longer."""


def seconds(tasks: Sequence[Task], jobs: int) -> float:
    """A rough estimate of the time that tasks take [s], from what was measured on one machine (docs/bench.md)."""
    return sum(map(_seconds, tasks)) / jobs


def forecast(tasks: Sequence[Task], jobs: int) -> str:
    """Say how many runs the tasks are and, beyond a minute, about how long they take."""
    scenes = sum(len(task) for task in tasks if task.cases.scenes)
    pairs = sum(map(len, tasks)) - scenes
    counts = " and ".join(f"{count:,} {name}" for count, name in ((pairs, "cases"), (scenes, "scenes")) if count)
    parts = [
        f"{len(found)} {name}{'s' * (len(found) > 1)}"
        for name, found in (
            ("scenario", {task.scenario.name for task in tasks}),
            ("method", {task.method.name for task in tasks}),
            ("variation", {task.variation for task in tasks} - {""}),
        )
        if found
    ]
    estimate = seconds(tasks, jobs)
    time = f"; about {duration(estimate)} with {jobs} process{'es' * (jobs > 1)}" if estimate > MINUTE else ""
    return f"{counts} to run: {', '.join(parts)}{time}"


def duration(estimate: float) -> str:
    """A time [s] in words, no more exact than it is known."""
    minutes = estimate / MINUTE
    return f"{minutes / 60:.1f} h" if minutes >= 100 else f"{minutes:.0f} min" if minutes >= 1 else f"{estimate:.0f} s"


def _seconds(task: Task) -> float:
    cycles = sum(chunk.cycles for chunk in cut([task]))
    if task.cases.scenes:
        source = task.scenario.encounters
        cars = USUAL_CARS
        if isinstance(source, Traffic):
            demand = source.demand
            per_hour = demand.through + demand.leaving + demand.merging + demand.hosts
            cars = demand.copies * per_hour / 3600.0 * PASSAGE_S
        return 1e-6 * CAR_US * cycles * cars
    each = LOGGED_US if isinstance(task.cases, LoggedCases) else PAIR_US[task.cases.world]
    each += SLOW_US.get(task.method.controller, 0.0)
    return 0.0 if task.method.is_human else 1e-6 * each * cycles

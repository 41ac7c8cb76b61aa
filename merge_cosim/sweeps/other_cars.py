"""The other cars around a case in a scene, for pictures: it is run once more, and SUMO writes where all cars are."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pandas as pd

from merge_cosim.scenarios.sources import Routes, Traffic
from merge_cosim.sumo.configuration import Configuration
from merge_cosim.sumo.demand import write_traffic
from merge_cosim.sumo.floating_car_data import read_floating_cars
from merge_cosim.sumo.outputs import SumoOutputs
from merge_cosim.sweeps.cases import LoggedCases
from merge_cosim.sweeps.single import trace_case
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.traffic_cases import TrafficCases

USUAL_LENGTH = 5.0
"""Length of a car whose type does not say it: SUMO's default [m]."""


def other_cars(task: Task, case: str) -> pd.DataFrame | None:
    """Where the other cars are in every cycle but the first, by the task of only this case.

    Returns:
        As `read_floating_cars`, with `length_m`; None for a pair of cars, and where the traffic has several copies of
        the ramp.
    """
    cases = task.cases
    if task.method.is_human or not isinstance(cases, LoggedCases | TrafficCases) or _copied(cases):
        return None
    with tempfile.TemporaryDirectory(prefix="merge-cosim-") as made:
        folder = Path(made)
        trace_case(task, case, outputs=SumoOutputs(fcd=folder / "cars.xml"))
        cars = read_floating_cars(folder / "cars.xml")
        if isinstance(cases, LoggedCases):
            scene, pair = cases.places[0]
            lengths, known = dict(zip(scene.car.tolist(), scene.length.tolist(), strict=True)), "car"
            two = {pair.host, pair.merging}
        else:
            file = (
                cases.traffic.file
                if isinstance(cases.traffic, Routes)
                else write_traffic(folder, cases.traffic.demand, task.ramp)
            )
            lengths, known = Configuration.read(file).lengths(), "type"
            two = set(case.split("/", 2)[1:])
    return cars[~cars["car"].isin(two)].assign(length_m=cars[known].map(lengths).fillna(USUAL_LENGTH))


def _copied(cases: LoggedCases | TrafficCases) -> bool:
    return isinstance(cases, TrafficCases) and isinstance(cases.traffic, Traffic) and cases.traffic.demand.copies > 1

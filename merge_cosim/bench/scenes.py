"""How fast living traffic runs: about two thousand cars on copies of a ramp, the hosts driven by a method."""

from __future__ import annotations

from typing import Any

from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.worker_session import WorkerSession

SCENARIO, METHOD = "traffic-dense", "pgm"
MODELS = ("Krauss", "IDM", "EIDM")
SETTINGS = {
    "encounters.replications": 1,
    "encounters.demand.duration": 180.0,
    "encounters.demand.warm_up": 30.0,
}


def scene_costs(copies: int) -> list[dict[str, Any]]:
    """A row per car-following model: cars on average, real-time factor of the whole loop, share of SUMO's steps.

    About 140 cars drive on each copy of the ramp.
    """
    return [_cost(model, copies) for model in MODELS]


def _cost(model: str, copies: int) -> dict[str, Any]:
    settings = SETTINGS | {"encounters.demand.car_following": model, "encounters.demand.copies": copies}
    (task,) = plan(SweepRequest([SCENARIO], [METHOD], settings=settings))
    ((run, (facts,)),) = task.runs(WorkerSession())
    effort = run.effort
    return {
        "model": model,
        "cars": round(effort.vehicle_steps / (facts["simulated_s"] / task.setting.dt)),
        "hosts": facts["hosts"],
        "meetings": facts["meetings"],
        "real_time_factor": round(facts["simulated_s"] / effort.wall_s, 1),
        "us_per_vehicle_step": round(1e6 * effort.wall_s / effort.vehicle_steps, 3),
        "ratio_to_bare_sumo": round(effort.wall_s / effort.step_s, 3),
    }

"""Other simulators of merges, and our learning environment, in the same run."""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from time import process_time
from typing import Any

from merge_cosim import __version__
from merge_cosim.bench.loops import run_json
from merge_cosim.core.files import shipped

HIGHWAY, COMMONROAD = "highway_merge.py", "commonroad_resimulation.py"
CASE = ("designed-2", "d+1_h15_m14")
"""The case that commonroad-sumo replays."""
ENCOUNTERS, WARM_UP, STEPS = 4096, 200, 400


def peers(commonroad_python: Path | None = None) -> list[dict[str, Any]]:
    """A row per simulator that is installed: steps, and vehicles times steps, per second of processor time.

    A step moves every car of one scene by one time step. The last column says how many times more steps our vector
    environment makes.

    Args:
        commonroad_python: Python of an environment with commonroad-sumo, eclipse-sumo and numpy; None: left out.
    """
    rows = []
    if importlib.util.find_spec("gymnasium") is not None:
        steps = environment_steps()
        rows.append(_row("merge-cosim Merge-v0", __version__, steps, 2 * steps))
    if importlib.util.find_spec("highway_env") is not None:
        rows.append(_timed("highway-env merge-v0", version("highway-env"), Path(sys.executable), HIGHWAY))
    if commonroad_python is not None:
        rows.append(_commonroad(commonroad_python))
    ours = rows[0]["steps_per_cpu_s"] if rows and rows[0]["simulator"].startswith("merge-cosim") else None
    return [row | {"ours_makes_more_by": round(ours / row["steps_per_cpu_s"], 1) if ours else None} for row in rows]


def environment_steps(
    encounters: int = ENCOUNTERS, warm_up: int = WARM_UP, steps: int = STEPS, **options: Any
) -> float:
    """Environment steps per second of processor time of the vector environment, under random actions.

    `steps` are timed after `warm_up` others, so that encounters of every age run side by side.
    """
    import gymnasium

    import merge_cosim.gym

    mode = "vector_entry_point"
    envs = gymnasium.make_vec(merge_cosim.gym.NAME, num_envs=encounters, vectorization_mode=mode, **options)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = [envs.action_space.sample() for _ in range(20)]
    for number in range(warm_up):
        envs.step(actions[number % len(actions)])
    begin = process_time()
    for number in range(steps):
        envs.step(actions[number % len(actions)])
    return steps * encounters / (process_time() - begin)


def _commonroad(python: Path) -> dict[str, Any]:
    scenario, case = CASE
    with tempfile.TemporaryDirectory() as folder:
        words = ("export", scenario, "--case", case, "--method", "acc", "--commonroad", "--out", folder, "--json")
        file = run_json([sys.executable, "-m", "merge_cosim.cli.main", *words])["commonroad"]
        return _timed("commonroad-sumo", None, python, COMMONROAD, file)


def _timed(name: str, number: str | None, python: Path, script: str, *arguments: str) -> dict[str, Any]:
    file = shipped("tools/bench") / script
    found = run_json([str(python), str(file), *arguments])
    return _row(
        name, number or found["version"], found["steps"] / found["cpu_s"], found["vehicle_steps"] / found["cpu_s"]
    )


def _row(name: str, number: str, steps: float, vehicle_steps: float) -> dict[str, Any]:
    return {
        "simulator": name,
        "version": number,
        "steps_per_cpu_s": round(steps, 1),
        "vehicle_steps_per_cpu_s": round(vehicle_steps, 1),
    }

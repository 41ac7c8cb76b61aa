"""How fast highway-env steps its merge scene, merge-v0 (needs `pip install highway-env`).

One step of the environment is several simulated steps; what is counted is simulated steps and vehicles times those.
"""

import json
from time import perf_counter, process_time

import gymnasium
import highway_env

EPISODES = 10


def main() -> None:
    """Run some episodes in which the ego keeps its lane and speed, and print the figures as JSON."""
    gymnasium.register_envs(highway_env)
    environment = gymnasium.make("merge-v0")
    scene = environment.unwrapped
    per_step = scene.config["simulation_frequency"] // scene.config["policy_frequency"]
    steps = vehicle_steps = 0
    wall = cpu = 0.0
    for episode in range(EPISODES):
        environment.reset(seed=episode)
        over = False
        begin, cpu_begin = perf_counter(), process_time()
        while not over:
            _, _, ended, cut_short, _ = environment.step(1)
            over = ended or cut_short
            steps += per_step
            vehicle_steps += per_step * len(scene.road.vehicles)
        wall += perf_counter() - begin
        cpu += process_time() - cpu_begin
    print(json.dumps({"steps": steps, "vehicle_steps": vehicle_steps, "wall_s": wall, "cpu_s": cpu}))


if __name__ == "__main__":
    main()

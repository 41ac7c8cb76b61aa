"""How fast commonroad-sumo steps a merge of ours, written by `merge-cosim export --commonroad` (argument: that file).

Needs `pip install commonroad-sumo eclipse-sumo` in an environment of its own: commonroad-sumo and the commonroad-io
that merge-cosim exports with cannot share one. SUMO replays both cars, and commonroad-sumo takes each step's states
over into its scenario; nothing plans or scores, which is less work than ours. Building the network and starting SUMO is
not counted.
"""

import json
import logging
import os
import sys
from importlib.metadata import version
from time import perf_counter, process_time

import sumo
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad_sumo import NonInteractiveSumoSimulation, SumoTrafficGenerationMode

ROUNDS = 20


def main() -> None:
    """Run the scenario some times and print the figures as JSON."""
    os.environ["SUMO_HOME"] = sumo.SUMO_HOME
    logging.disable(logging.WARNING)
    scenario, _ = CommonRoadFileReader(sys.argv[1]).open()
    last = max(obstacle.prediction.final_time_step for obstacle in scenario.dynamic_obstacles)
    steps = vehicle_steps = 0
    wall = cpu = 0.0
    for _ in range(ROUNDS):
        simulation = NonInteractiveSumoSimulation.from_scenario(scenario, SumoTrafficGenerationMode.UNSAFE_RESIMULATION)
        begin, cpu_begin = perf_counter(), process_time()
        result = simulation.run(last)
        wall += perf_counter() - begin
        cpu += process_time() - cpu_begin
        steps += last
        vehicle_steps += sum(
            1 + obstacle.prediction.final_time_step - obstacle.initial_state.time_step
            for obstacle in result.scenario.dynamic_obstacles
        )
    figures = {"steps": steps, "vehicle_steps": vehicle_steps, "wall_s": wall, "cpu_s": cpu}
    print(json.dumps({"version": version("commonroad-sumo"), **figures}))


if __name__ == "__main__":
    main()

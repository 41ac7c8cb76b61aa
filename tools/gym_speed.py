"""Environment steps per second of CPU time of the vector environment, under random actions."""

import sys
import time

import gymnasium

import merge_cosim.gym

ENCOUNTERS, WARM_UP, STEPS = 4096, 200, 400


def steps_per_second(
    encounters: int = ENCOUNTERS, warm_up: int = WARM_UP, steps: int = STEPS, **options: object
) -> float:
    """Measure one environment, after so many steps that encounters of every age run side by side."""
    mode = "vector_entry_point"
    envs = gymnasium.make_vec(merge_cosim.gym.NAME, num_envs=encounters, vectorization_mode=mode, **options)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = [envs.action_space.sample() for _ in range(20)]
    for number in range(warm_up):
        envs.step(actions[number % len(actions)])
    begin = time.process_time()
    for number in range(steps):
        envs.step(actions[number % len(actions)])
    return steps * encounters / (time.process_time() - begin)


if __name__ == "__main__":
    for scenario in sys.argv[1:] or ["designed-3", "designed-2"]:
        print(f"{scenario}: {steps_per_second(scenario=scenario):,.0f} environment steps per second of CPU time")

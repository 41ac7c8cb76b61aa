"""The compiled action model of the particle filter against its equations, written with numpy."""

import numpy as np

from merge_cosim.estimators.compiled.particle_filter import NOT_YIELD, YIELD, ActionLaw, mean_accelerations


def test_mean_accelerations_follow_the_equations():
    random, law = np.random.default_rng(4), ActionLaw(15.0, 0.5, 2.0, 0.4, -4.0, 3.0)
    shape = (7, 50)
    maneuver, station = random.integers(0, 3, shape), random.uniform(-120.0, 0.0, shape)
    speed, arrival = random.uniform(0.0, 30.0, shape), random.uniform(0.0, 8.0, 7)
    host, merging = random.uniform(4.0, 8.0, (2, 7))
    found = mean_accelerations(maneuver, station, speed, arrival, host, merging, law)
    time = np.maximum(arrival, 0.5)[:, None]
    free = np.clip(0.4 * (15.0 - speed), -4.0, 3.0)
    yields = 2.0 * (-(host[:, None] + 2.0) - station - speed * time) / time**2
    beats = 2.0 * (merging[:, None] + 2.0 - station - speed * time) / time**2
    wanted = np.where(maneuver == YIELD, np.minimum(free, yields), free)
    wanted = np.where(maneuver == NOT_YIELD, np.maximum(free, beats), wanted)
    np.testing.assert_allclose(found, np.clip(wanted, -4.0, 3.0), rtol=1e-12, atol=1e-12)
    assert 0.1 < np.mean(found != free) < 0.9

"""The particle filter against an exact filter on a grid, a Kalman filter and the package particles."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import norm

from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import normal, stream_keys
from merge_cosim.estimators.compiled.normal import normals, quantile
from merge_cosim.estimators.dbn_pf import DbnPf, Maneuver
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.particles import Cloud, Dice, low_variance
from merge_cosim.report.belief_cases import pulls_ahead, stays_behind

MODEL = replace(IntentionModel.load("us101-ngsim"), merge_speed=15.0)
TAU, HALF = 0.5, 0.3
"""Interval of the updates, and (tau + dt) / 2 in `s' = s + v tau + (v' - v) (tau + dt) / 2`."""

RATE = 0.3
"""How often maneuvers change in the comparison with the grid [1/s]: more than by default, so that it counts."""


def many(scene, count):
    return Observation(*(np.repeat(getattr(scene, name), count) for name in Observation.__dataclass_fields__))


def ready(runs, **parameters):
    estimator = DbnPf(**parameters)
    estimator.use(MODEL)
    estimator.watch()
    estimator.start(runs, Setting())
    rows = np.arange(runs)
    estimator.reset(rows, rows * 0 - 1, stream_keys(rows.astype(str), 11))
    return estimator


def watch(estimator, scenes, runs):
    """The estimator's steps, one every half second."""
    steps = []
    for t, scene in enumerate(scenes):
        estimator.update(many(scene, runs))
        if t and t % 5 == 0:
            steps.append(estimator.last_step)
    return steps


class GridFilter:
    """Exact Bayes filter on cells of (maneuver, s, v) around the car, the noise on Gauss-Hermite nodes.

    Its only approximation is the grid: masses are shared between the four nearest cells. It shares the action model
    with the particle filter (which has its own test) and nothing else.
    """

    def __init__(self, scene, cell=(0.06, 0.05), reach=(2.6, 1.9)):
        self.cell = np.array(cell)
        self.offsets = [np.arange(-round(r / c), round(r / c) + 1) * c for r, c in zip(reach, cell, strict=True)]
        self.model, self.scene = ready(1), scene
        nodes, weights = np.polynomial.hermite_e.hermegauss(9)
        self.noise = list(zip(0.5 * nodes, weights / weights.sum(), strict=True))
        self.mass = np.array([0.4, 0.4, 0.2])[:, None, None] * self.at_observation(scene)

    def axes(self, scene):
        return scene.merging_station[0] + self.offsets[0], scene.merging_speed[0] + self.offsets[1]

    def at_observation(self, scene):
        density = norm.pdf(self.offsets[0] / 0.5)[:, None] * norm.pdf(self.offsets[1] / 0.3)
        return density / density.sum()

    def update(self, scene):
        change = 1 - np.exp(-RATE * TAU)
        total = self.mass.sum(axis=0)
        mass = (1 - change) * self.mass + change / 2 * (total - self.mass)
        station, speed = (a.ravel() for a in np.meshgrid(*self.axes(self.scene), indexing="ij"))
        moved = np.zeros_like(mass)
        for one in Maneuver:
            cloud = Cloud(station[None], speed[None], np.full((1, len(station)), int(one)))
            seen = self.scene
            mean = self.model.mean_acceleration(cloud, seen.host_arrival, seen.host_length, seen.merging_length)[0]
            for noise, share in self.noise:
                speed_after = np.maximum(speed + (mean + noise) * TAU, 0.0)
                station_after = station + speed * TAU + (speed_after - speed) * HALF
                moved[one] += self.deposit(station_after, speed_after, mass[one].ravel() * share, scene)
        self.scene = scene
        likelihood = self.at_observation(scene)  # the observation's density seen from the cells is the same function
        posterior = moved * likelihood
        posterior /= posterior.sum()
        belief = posterior.sum(axis=(1, 2))
        self.mass = 0.95 * posterior + 0.05 * belief[:, None, None] * likelihood
        return belief

    def deposit(self, station, speed, mass, scene):
        shape = tuple(len(o) for o in self.offsets)
        origin = [axis[0] for axis in self.axes(scene)]
        place = [(x - o) / c for x, o, c in zip((station, speed), origin, self.cell, strict=True)]
        base = [np.floor(p).astype(int) for p in place]
        result = np.zeros(shape)
        for i in (0, 1):
            for j in (0, 1):
                share = np.abs(1 - i - (place[0] - base[0])) * np.abs(1 - j - (place[1] - base[1]))
                row, column = base[0] + i, base[1] + j
                inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
                np.add.at(result, (row[inside], column[inside]), (mass * share)[inside])
        return result


@pytest.mark.parametrize("driver", [stays_behind, pulls_ahead])
def test_belief_is_that_of_an_exact_filter_on_a_grid(driver):
    runs, particles = 12, 4000
    scenes = driver()[35:86] if driver is pulls_ahead else driver()[60:96]
    steps = watch(ready(runs, particles=particles, change_rate=RATE), scenes, runs)
    grid = GridFilter(scenes[0])
    beliefs = np.array([grid.update(scene) for scene in scenes[5::5]])
    assert np.ptp(beliefs[:, Maneuver.NOT_YIELD]) > 0.2  # there is something to follow
    for exact, step in zip(beliefs, steps, strict=True):
        error = step.belief.std(axis=1, ddof=1) / np.sqrt(runs)
        # 4 standard errors, and what the cells' width adds
        assert (np.abs(step.belief.mean(axis=1) - exact) < 4 * error + 0.004).all()
        assert (step.belief.std(axis=1) < 0.05).all()


def linear_steps(runs, particles):
    """A driver who ignores the host, without bounds, changes or redraws: a linear Gaussian model."""
    estimator = ready(
        runs,
        particles=particles,
        start_yield=0.0,
        start_not_yield=0.0,
        change_rate=0.0,
        redrawn=0.0,
        min_acceleration=-1e6,
        max_acceleration=1e6,
    )
    scenes = stays_behind()[20:71]
    return watch(estimator, scenes, runs), scenes


def linear_model():
    """State (s, v): transition matrix and constant, noise of the acceleration and of what is observed."""
    gain = np.array([HALF * TAU, TAU])
    move = np.array([[1.0, TAU], [0.0, 1.0]]) - 0.4 * np.outer(gain, [0.0, 1.0])
    return move, 0.4 * 15.0 * gain, 0.5 * gain, np.diag([0.5**2, 0.3**2])


def observed(scenes):
    return np.array([[s.merging_station[0], s.merging_speed[0]] for s in scenes[::5]])


def kalman(scenes):
    """Mean and covariance after each update."""
    move, constant, gain, noise = linear_model()
    seen = observed(scenes)
    mean, covariance, found = seen[0], noise.copy(), []
    for z in seen[1:]:
        mean, covariance = move @ mean + constant, move @ covariance @ move.T + np.outer(gain, gain)
        innovation = covariance + noise
        error = z - mean
        filtered = covariance @ np.linalg.inv(innovation)
        mean, covariance = mean + filtered @ error, covariance - filtered @ covariance
        found.append((mean, covariance))
    return found


def means(step):
    return np.stack([(step.weights * x).sum(axis=1) for x in (step.between.station, step.between.speed)])


def test_a_linear_gaussian_case_is_the_kalman_filter():
    runs = 16
    steps, scenes = linear_steps(runs, 4000)
    found = kalman(scenes)
    assert len(found) == len(steps) == 10
    for (mean, covariance), step in zip(found, steps, strict=True):
        ours = means(step)
        error = ours.std(axis=1, ddof=1) / np.sqrt(runs)
        assert (np.abs(ours.mean(axis=1) - mean) < 4.5 * error).all()
        assert (error < 0.01).all()
        for row, x in enumerate((step.between.station, step.between.speed)):
            # of all particles of all runs, for each run's own mean is off by its error
            spread = (step.weights * (x - ours[row].mean()) ** 2).sum(axis=1).mean()
            assert spread == pytest.approx(covariance[row, row], rel=0.05)


def test_a_linear_gaussian_case_is_that_of_the_package_particles():
    import particles
    from particles import distributions as laws
    from particles import state_space_models as models
    from particles.collectors import Moments

    move, constant, gain, noise = linear_model()
    steps, scenes = linear_steps(8, 4000)
    seen = observed(scenes)

    class Car(models.StateSpaceModel):
        """State (s, v); the acceleration's noise is one-dimensional, so a hair of independent noise is added."""

        def PX0(self):
            return laws.MvNormal(loc=seen[0], cov=noise)

        def PX(self, t, xp):
            return laws.MvNormal(loc=xp @ move.T + constant, cov=np.outer(gain, gain) + 1e-10 * np.eye(2))

        def PY(self, t, xp, x):
            return laws.MvNormal(loc=x, cov=noise)

    class FromTheSecond(models.Bootstrap):
        """Its first observation is where the cloud starts, so it weighs nothing."""

        def logG(self, t, xp, x):
            return np.zeros(len(x)) if t == 0 else super().logG(t, xp, x)

    np.random.seed(5)  # noqa: NPY002 - the package draws from numpy's global state
    theirs = []
    for _ in range(8):
        smc = particles.SMC(
            fk=FromTheSecond(ssm=Car(), data=list(seen)),
            N=4000,
            resampling="systematic",
            ESSrmin=1.0,
            collect=[Moments()],
        )
        smc.run()
        theirs.append([moments["mean"] for moments in smc.summaries.moments[1:]])
    theirs = np.array(theirs)
    ours = np.array([means(step).T for step in steps]).transpose(1, 0, 2)
    assert ours.shape == theirs.shape == (8, 10, 2)
    error = np.sqrt((ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / 8)
    assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 5 * error).all()
    # and as precise: no more than half again their spread
    assert (ours.std(axis=0) < 1.5 * theirs.std(axis=0) + 0.005).all()


def numpy_step(estimator, seen, before, arrival, keys, first):
    """The same update written for whole batches with numpy: cloud afterwards and belief.

    `first`: how many numbers of each stream were drawn before.
    """
    count, new = estimator.particles, round(estimator.redrawn * estimator.particles)
    rows = np.arange(len(keys))
    dice = Dice(len(keys))
    dice.reset(rows, keys)
    dice.uniform(rows, first)
    chance = dice.uniform(rows, count) * (2.0 / -np.expm1(-estimator.change_rate * TAU))
    maneuver = (before.maneuver + (chance < 2.0) + (chance < 1.0)) % 3
    time = np.maximum(arrival, estimator.min_arrival)[:, None]
    yields, beats = maneuver == Maneuver.YIELD, maneuver == Maneuver.NOT_YIELD
    aim = np.where(yields, -(seen.host_length + 2.0)[:, None], (seen.merging_length + 2.0)[:, None])
    needed = (aim - before.station - before.speed * time) * (2.0 / time**2)
    mean = np.clip(0.4 * (15.0 - before.speed), -4.0, 3.0)
    mean = np.where(yields, np.minimum(mean, needed), np.where(beats, np.maximum(mean, needed), mean))
    acceleration = np.clip(mean, -4.0, 3.0) + 0.5 * dice.normal(rows, count)
    speed = np.maximum(before.speed + acceleration * TAU, 0.0)
    station = before.station + before.speed * (TAU - HALF) + speed * HALF
    away = ((seen.merging_station[:, None] - station) / 0.5) ** 2 + ((seen.merging_speed[:, None] - speed) / 0.3) ** 2
    weights = np.exp(-0.5 * (away - away.min(axis=1, keepdims=True)))
    weights /= weights.sum(axis=1, keepdims=True)
    belief = np.stack([np.where(maneuver == one, weights, 0.0).sum(axis=1) for one in Maneuver])
    chosen = low_variance(weights, dice.uniform(rows, 1)[:, 0], count - new)
    noise = dice.normal(rows, 2 * new)
    at_station = seen.merging_station[:, None] + 0.5 * noise[:, :new]
    at_speed = np.maximum(seen.merging_speed[:, None] + 0.3 * noise[:, new:], 0.0)
    at_maneuver = low_variance(np.ascontiguousarray(belief.T), dice.uniform(rows, 1)[:, 0], new)
    pairs = ((station, at_station), (speed, at_speed), (maneuver, at_maneuver))
    return [np.hstack([np.take_along_axis(one, chosen, axis=1), drawn]) for one, drawn in pairs], belief


def test_the_compiled_update_is_that_of_numpy():
    runs = 300
    estimator, keys = ready(runs), stream_keys(np.arange(runs).astype(str), 11)
    scenes = [many(scene, runs) for scene in pulls_ahead()[:31]]
    before, drawn, arrival = None, 2 * 200 + 1, scenes[0].host_arrival
    for t, scene in enumerate(scenes):
        estimator.update(scene)
        if t and t % 5 == 0:
            step = estimator.last_step
            after, belief = numpy_step(estimator, scene, step.before, arrival, keys, drawn)
            drawn, arrival = drawn + 200 + 200 + 1 + 20 + 1, scene.host_arrival
            np.testing.assert_allclose(step.belief, belief, rtol=0, atol=1e-12)
            for one, other in zip((step.after.station, step.after.speed, step.after.maneuver), after, strict=True):
                np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)
            if before is not None:
                np.testing.assert_array_equal(step.before.station, before)
            before = step.after.station


def test_the_compiled_quantile_is_that_of_scipy():
    shares = np.concatenate(
        [np.random.default_rng(0).random(2000), 0.5 ** np.arange(1, 54), 1 - 0.5 ** np.arange(1, 54)]
    )
    np.testing.assert_array_equal([quantile(share) for share in shares], ndtri(shares))
    key = stream_keys(np.array(["a"]), 0)
    filled = np.empty(500)
    normals(key[0], np.uint64(7), filled)
    np.testing.assert_array_equal(filled, normal(key, np.array([7]), 500)[0])

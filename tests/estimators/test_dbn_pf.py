"""DBN-PF: the action model by hand, and a belief that moves the right way."""

from dataclasses import replace

import numpy as np
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.estimators.base import estimators
from merge_cosim.estimators.dbn_pf import DbnPf, Maneuver
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.estimators.particles import Cloud
from merge_cosim.report.belief_cases import pulls_ahead, stays_behind

MODEL = replace(IntentionModel.load("us101-ngsim"), merge_speed=15.0)
CEILING = np.log(399)
"""Log-odds of 200 particles that all say NOT_YIELD."""


def ready(count=1, seed=0, **parameters):
    estimator = DbnPf(**parameters)
    estimator.use(MODEL)
    estimator.watch()
    estimator.start(count, Setting())
    rows = np.arange(count)
    estimator.reset(rows, rows * 0 - 1, stream_keys(rows.astype(str), seed))
    return estimator


def many(scene, count):
    return Observation(*(np.repeat(getattr(scene, name), count) for name in Observation.__dataclass_fields__))


def watched(scenes, estimator, count=1):
    return [estimator.update(many(scene, count)) for scene in scenes]


def mean_of(maneuver, station, speed, arrival, **parameters):
    cloud = Cloud(np.array([[station]]), np.array([[speed]]), np.array([[int(maneuver)]]))
    one = np.array
    return ready(**parameters).mean_acceleration(cloud, one([arrival]), one([5.0]), one([4.0]))[0, 0]


def test_action_model_by_hand():
    # free: 0.4 (15 - 14)
    assert mean_of(Maneuver.IGNORE, -50.0, 14.0, 3.0) == pytest.approx(0.4)
    # 5 + 2 m behind the merging point after 3 s: 2 (-7 + 50 - 42) / 9; 4 + 2 m past it: 2 (6 + 50 - 42) / 9 > 3
    assert mean_of(Maneuver.YIELD, -50.0, 14.0, 3.0) == pytest.approx(2 / 9)
    assert mean_of(Maneuver.NOT_YIELD, -50.0, 14.0, 3.0) == 3.0
    assert mean_of(Maneuver.NOT_YIELD, -45.0, 14.0, 3.0) == pytest.approx(2.0)
    # constraints that do not bind leave free driving
    assert mean_of(Maneuver.YIELD, -90.0, 14.0, 3.0) == pytest.approx(0.4)
    assert mean_of(Maneuver.NOT_YIELD, -20.0, 14.0, 3.0) == pytest.approx(0.4)
    # bounds, and the shortest time to arrival: 2 (-7 + 8 - 7) / 0.25
    assert mean_of(Maneuver.YIELD, -8.0, 14.0, 0.0) == -4.0
    assert mean_of(Maneuver.YIELD, -8.0, 14.0, 0.0, min_acceleration=-99.0) == pytest.approx(-48.0)
    assert mean_of(Maneuver.IGNORE, -8.0, 1.0, 3.0) == 3.0


def test_particles_move_as_the_plant_does():
    estimator = ready(2, acceleration_noise=0.0, change_rate=0.0, start_yield=0.0, start_not_yield=0.0)
    scene = many(stays_behind()[0], 2)
    for _ in range(6):
        estimator.update(scene)
    step = estimator.last_step
    station, speed = step.before.station.copy(), step.before.speed.copy()
    acceleration = np.clip(0.4 * (15.0 - speed), -4.0, 3.0)
    for _ in range(5):
        speed += acceleration * 0.1
        station += speed * 0.1
    np.testing.assert_allclose(step.between.station, station)
    np.testing.assert_allclose(step.between.speed, speed)


def test_starts_with_the_given_shares_around_the_observation():
    estimator = ready(40)
    scene = many(stays_behind()[0], 40)
    # T_m > T_h: who ignores goes second
    np.testing.assert_allclose(estimator.update(scene), np.log(0.4 / 0.6))
    for _ in range(5):
        estimator.update(scene)
    start = estimator.last_step.before
    assert (np.count_nonzero(start.maneuver == Maneuver.YIELD, axis=1) == 80).all()
    assert (np.count_nonzero(start.maneuver == Maneuver.IGNORE, axis=1) == 40).all()
    assert start.station.mean() == pytest.approx(scene.merging_station[0], abs=0.03)
    assert start.station.std() == pytest.approx(0.5, abs=0.02)
    assert start.speed.std() == pytest.approx(0.3, abs=0.02)


def test_weights_and_belief_are_those_of_the_particles():
    estimator = ready(3)
    scenes = [many(scene, 3) for scene in pulls_ahead()[:6]]
    for scene in scenes:
        odds = estimator.update(scene)
    step, now = estimator.last_step, scenes[-1]
    density = np.exp(
        -0.5 * ((now.merging_station[:, None] - step.between.station) / 0.5) ** 2
        - 0.5 * ((now.merging_speed[:, None] - step.between.speed) / 0.3) ** 2
    )
    np.testing.assert_allclose(step.weights, density / density.sum(axis=1, keepdims=True))
    for one in Maneuver:
        share = (step.weights * (step.between.maneuver == one)).sum(axis=1)
        np.testing.assert_allclose(step.belief[one], share)
    earlier = now.merging_arrival < now.host_arrival
    p = np.clip(step.belief[1] + earlier * step.belief[2], 1 / 400, 399 / 400)
    np.testing.assert_allclose(odds, np.log(p / (1 - p)))


def test_updates_every_half_second_and_holds_in_between():
    odds = np.array(watched(pulls_ahead(), ready()))[:, 0]
    changed = np.flatnonzero(np.diff(odds)) + 1
    assert (changed % 5 == 0).all()
    assert len(changed) > 10


def test_encounters_that_begin_at_different_cycles_do_not_disturb_each_other():
    scenes = pulls_ahead()[:40]
    alone = np.array(watched(scenes, ready()))[:, 0]
    estimator = ready(2)
    key = stream_keys(np.array(["0"]), 0)
    joined = []
    for t, scene in enumerate(scenes):
        if t == 3:
            estimator.reset(np.array([1]), np.array([-1]), key)
        late = scenes[max(t - 3, 0)]
        both = Observation(
            *(np.concatenate([getattr(scene, f), getattr(late, f)]) for f in Observation.__dataclass_fields__)
        )
        joined.append(estimator.update(both))
    joined = np.array(joined)
    np.testing.assert_array_equal(joined[:, 0], alone)
    np.testing.assert_array_equal(joined[3:, 1], alone[:-3])


def test_batch_of_one_and_full_batch_agree_to_the_bit():
    count, rng = 96, np.random.default_rng(0)
    shift, faster = rng.uniform(-20, 20, count), rng.uniform(-4, 4, count)
    scenes = [
        replace(many(s, count), merging_station=s.merging_station + shift, merging_speed=s.merging_speed + faster)
        for s in pulls_ahead()[:60]
    ]
    batch = ready(count)
    whole = np.array([batch.update(s) for s in scenes])
    for i in (0, 17, 95):
        single = ready()
        single.reset(np.array([0]), np.array([-1]), stream_keys(np.array([str(i)]), 0))
        alone = [
            single.update(Observation(*(getattr(s, f)[i : i + 1] for f in Observation.__dataclass_fields__)))[0]
            for s in scenes
        ]
        np.testing.assert_array_equal(alone, whole[:, i])


def one_update_after(acceleration, count=200):
    """Belief after one update, level with a host 5 s away, having driven this acceleration."""
    estimator = ready(count)
    start = Observation(*(np.full(count, x) for x in (-75.0, 15.0, -75.0, 15.0, 5.0, 5.0)))
    before = estimator.update(start)
    for _ in range(4):
        estimator.update(start)
    speed = 15.0 + 0.5 * acceleration
    now = replace(
        start,
        host_station=np.full(count, -67.5),
        merging_station=np.full(count, -75.0 + 7.5 + acceleration * 0.15),
        merging_speed=np.full(count, speed),
    )
    estimator.update(now)
    return before.mean(), estimator.last_step.belief.mean(axis=1)


def test_an_observed_acceleration_speaks_for_not_yielding():
    # the blog post says the particles shift toward yielding, which its sentence before contradicts
    _, faster = one_update_after(+1.0)
    _, slower = one_update_after(-1.0)
    assert faster[Maneuver.NOT_YIELD] > 0.45 > 0.35 > faster[Maneuver.YIELD]
    assert slower[Maneuver.YIELD] > 0.45 > 0.35 > slower[Maneuver.NOT_YIELD]


def test_who_stays_behind_is_soon_known_to_yield():
    odds = np.array(watched(stays_behind(), ready(40), 40))
    assert odds.shape == (121, 40)
    assert (odds[60:] < 0).mean() > 0.95
    assert np.median(odds[100]) < -2
    scene = stays_behind()[-1]
    assert scene.merging_station < scene.host_station < 0


def test_who_pulls_ahead_is_known_not_to_yield_before_he_arrives():
    odds = np.array(watched(pulls_ahead(), ready(40), 40))
    scene = pulls_ahead()[-1]
    assert scene.merging_station > scene.host_station
    np.testing.assert_array_equal(odds[:50], np.array(watched(stays_behind(), ready(40), 40))[:50])
    assert np.median(odds[50]) < 0 < np.median(odds[100])
    assert (odds[-10:] > 0).mean() > 0.95


def test_belief_never_reaches_certainty_and_survives_absurd_observations():
    estimator = ready()
    scene = stays_behind()[0]
    for t in range(60):
        odds = estimator.update(replace(scene, merging_station=np.array([(-1.0) ** t * 1e5])))
        assert np.abs(odds) <= CEILING + 1e-9
    assert ready(particles=1).update(scene)[0] == pytest.approx(0.0)


def test_without_change_or_redraw_a_lost_maneuver_stays_lost():
    fixed = ready(40, change_rate=0.0, redrawn=0.0, start_yield=1.0, start_not_yield=0.0)
    np.testing.assert_allclose(watched(pulls_ahead(), fixed, 40), -CEILING)
    free = ready(40, start_yield=1.0, start_not_yield=0.0)
    assert np.median(np.array(watched(pulls_ahead(), free, 40))[-1]) > 0


def test_shares_at_the_start_that_exceed_one_are_refused():
    with pytest.raises(UserError, match="more than 1 together"):
        estimators.build("dbn-pf", {"start_yield": 0.7}, "dbn-pf")
    np.testing.assert_allclose(DbnPf(start_yield=0.6).start_belief, [0.6, 0.4, 0.0], atol=1e-12)

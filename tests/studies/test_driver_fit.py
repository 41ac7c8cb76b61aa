"""The likelihood of a track against a sum over all paths, and constants found again in tracks made with them."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.stats import norm

from merge_cosim.core.encounter import Encounters, Ragged, ReplayLog
from merge_cosim.core.observation import Setting
from merge_cosim.estimators.compiled.drivers import IGNORE, YIELD, reacting
from merge_cosim.estimators.interactive import Interactive
from merge_cosim.studies.driver_fit import Tracks, autoregression, constants, log_likelihoods, maximise, resampled

SETTING = Setting(29.0)
PLAIN = Interactive(
    start_yield=0.7, start_not_yield=0.0, start_ignore=0.3, start_accelerate=0.0, start_late=0.0, min_margin=1.5,
    max_margin=1.5, roughness_levels=1,
)  # fmt: skip
HOST, HOST_SPEED, LENGTH, DT = -70.0, 18.0, 5.0, 0.1


def logged(speeds: list[np.ndarray], start: float = -60.0) -> Encounters:
    """A pair for each row of speeds of the merging car; each two are those of one car."""
    n = len(speeds)
    stations = [start + np.concatenate([[0.0], np.cumsum(speed[1:] * DT)]) for speed in speeds]
    hosts = [HOST + HOST_SPEED * DT * np.arange(len(speed)) for speed in speeds]
    names = np.array([f"c{number}" for number in range(n)])
    log = ReplayLog(
        Ragged.of(stations), Ragged.of(speeds), Ragged.of(hosts), *(np.array([len(one) for one in speeds]),) * 2
    )
    states = {
        "host_station": HOST, "host_speed": HOST_SPEED, "host_length": LENGTH, "merging_station": start,
        "merging_speed": np.array([speed[0] for speed in speeds]), "merging_length": LENGTH,
    }  # fmt: skip
    made = Encounters.unlogged(names, "us101", "ngsim", **states)
    return replace(made, log=log, car=np.array([f"m{number // 2}" for number in range(n)]))


def plan(kind: int, station: float, speed: float, cycle: int) -> float:
    host = HOST + HOST_SPEED * DT * cycle
    return reacting(kind, 1.5, host, HOST_SPEED, LENGTH, station, speed, PLAIN.law(SETTING))


def test_the_likelihood_is_the_sum_over_all_paths():
    """Every sequence of reacted or not and of type over three accelerations, with its probability, one by one."""
    speed = np.array([20.0, 19.95, 19.8, 19.6, 19.6])  # the last state of a log has no speed of the host
    station = logged([speed]).log.merging_station[0]
    accelerations = np.diff(speed)[:3] / DT
    shares = {YIELD: 0.7, IGNORE: 0.3}
    acts, changes = 1 - np.exp(-DT / PLAIN.reaction_time), PLAIN.change_rate * DT
    keep = np.exp(-DT / PLAIN.correlation_time)
    innovation = np.sqrt(PLAIN.sigma**2 * (1 - keep**2) + PLAIN.white**2)

    def mean(state: tuple[bool, int], cycle: int) -> float:
        return plan(state[1], station[cycle], speed[cycle], cycle) if state[0] else 0.0

    total = 0.0
    for path in product(product((False, True), shares), repeat=4):
        p = 0.0 if path[0][0] else shares[path[0][1]]
        for cycle, (before, now) in enumerate(pairwise(path)):
            p *= (acts if now[0] else 1 - acts) if not before[0] else float(now[0])
            p *= changes * shares[now[1]] + (1 - changes) * (before[1] == now[1])
            off = accelerations[cycle] - mean(now, cycle)
            if cycle == 0:
                density = norm.pdf(off, scale=np.hypot(PLAIN.sigma, innovation))
            else:
                density = norm.pdf(off - keep * (accelerations[cycle - 1] - mean(now, cycle - 1)), scale=innovation)
            p *= (1 - PLAIN.outlier) * density + PLAIN.outlier / 10
        total += p
    tracks = Tracks.of(logged([speed]), SETTING)
    assert tracks.seconds == pytest.approx([0.3])
    assert log_likelihoods(PLAIN, tracks) == pytest.approx([np.log(total)], abs=1e-9)


def test_what_is_not_scored():
    """An acceleration of more than 5 m/s^2, and what comes after either car has reached the merging point."""
    speeds = [np.array([20.0, 20.0, 20.0, 20.6, 20.6, 20.6, 20.6]), np.full(60, 20.0), np.full(4, 20.0)]
    tracks = Tracks.of(logged(speeds), SETTING)
    assert tracks.seconds == pytest.approx([0.4, 2.9, 0.2])  # the last state has no speed of the host
    together = log_likelihoods(PLAIN, tracks)
    alone = [log_likelihoods(PLAIN, Tracks.of(logged([speed]), SETTING))[0] for speed in speeds]
    assert together == pytest.approx(alone, abs=1e-9)


def drawn(truth: Interactive, count: int, cycles: int, seed: int) -> Encounters:
    """Pairs whose drivers are those of the filter, with one margin and no levels of roughness."""
    rng, speeds = np.random.default_rng(seed), []
    keep = np.exp(-DT / truth.correlation_time)
    innovation = np.sqrt(truth.sigma**2 * (1 - keep**2) + truth.white**2)
    for _ in range(count):
        kind = IGNORE if rng.random() < truth.start_ignore else YIELD
        acts, stations, speed, a = False, [-60.0], [20.0], 0.0
        for cycle in range(cycles):
            acts |= rng.random() < 1 - np.exp(-DT / truth.reaction_time)
            if rng.random() < truth.change_rate * DT:
                kind = IGNORE if rng.random() < truth.start_ignore else YIELD
            if cycle:
                before = plan(kind, stations[-2], speed[-2], cycle - 1) if acts else 0.0
                off = keep * (a - before) + innovation * rng.normal()
            else:
                off = np.hypot(truth.sigma, innovation) * rng.normal()
            a = off + (plan(kind, stations[-1], speed[-1], cycle) if acts else 0.0)
            speed.append(speed[-1] + a * DT)
            stations.append(stations[-1] + speed[-1] * DT)
        speeds.append(np.array(speed))
    return logged(speeds)


def test_constants_are_found_again():
    truth = replace(PLAIN, sigma=0.6, outlier=1e-4, reaction_time=0.6)
    tracks = Tracks.of(drawn(truth, 120, 25, 3), SETTING)
    free = "sigma", "reaction_time", "start_ignore"
    start = replace(PLAIN, outlier=1e-4, start_yield=0.5, start_ignore=0.5)
    found, most = maximise(tracks, start, free, rounds=1, steps=12)
    assert most > log_likelihoods(truth, tracks).sum() > log_likelihoods(start, tracks).sum()
    draws = [constants(one) for one in resampled(tracks, found, free, draws=8, steps=6)]
    for name in free:
        values = [draw[name] for draw in draws]
        assert getattr(found, name) == pytest.approx(getattr(truth, name), abs=3 * np.std(values, ddof=1)), name
    again = [constants(one) for one in resampled(tracks, found, free, draws=1, steps=6)]
    assert again == draws[:1]


def test_an_autoregression_by_hand():
    speeds = [np.array([10.0, 10.1, 10.15, 10.175, 10.2, 10.2]), np.array([10.0, 9.8, 9.72, 9.66, 9.66])]
    tracks = Tracks.of(logged(speeds), SETTING)
    a, b = (np.diff(speed)[:-1] / DT for speed in speeds)
    before, now = np.concatenate([a[:-1], b[:-1]]), np.concatenate([a[1:], b[1:]])
    factor = before @ now / (before @ before)
    sigma, first = (now - factor * before).std(), np.concatenate([a, b]).std()
    expected = [
        norm.logpdf(one[0], scale=first) + norm.logpdf(one[1:] - factor * one[:-1], scale=sigma).sum() for one in (a, b)
    ]
    assert autoregression(tracks, tracks, 1) == pytest.approx(expected)

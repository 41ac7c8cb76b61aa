"""The recorded host: its stations and measures are those of the log, and it never fails on real pairs."""

import numpy as np
import pytest

from merge_cosim.core.encounter import NEVER, Encounters, Ragged, ReplayLog
from merge_cosim.core.observation import Setting
from merge_cosim.merging_cars.replay import Replay
from merge_cosim.ngsim.pairing.encounters import site_encounters
from merge_cosim.ngsim.sites import site
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.logged_host import LoggedHostWorld, Undecided


def run_logged(encounters, traced=()):
    world = LoggedHostWorld(len(encounters))
    return Loop(world, encounters, Undecided(), Replay(), Rules(), Setting(), traced).run()


def logged_pair(host, merging, label=0):
    one, track = np.array, Ragged.of
    log = ReplayLog(track([merging]), track([np.full(len(merging), 10.0)]), track([host]), one([50]), one([NEVER]))
    text = {name: one(["x"]) for name in ("case", "site", "source", "car")}
    numbers = {
        "host_station": host[:1],
        "host_speed": one([(host[1] - host[0]) / 0.1]),
        "host_length": one([5.0]),
        "merging_station": merging[:1],
        "merging_speed": one([(merging[1] - merging[0]) / 0.1]),
        "merging_length": one([4.0]),
        "merge_position": one([0.0]),
    }
    flags = {"smoothed_source": one([False]), "length_missing": one([False])}
    return Encounters(**text, **numbers, label=one([label]), **flags, log=log)


def test_the_host_meets_its_log_and_goes_on_after_it():
    cycles = np.arange(60)
    host, merging = -60.0 + 1.5 * cycles, -50.0 + 1.0 * cycles  # 15 m/s and 10 m/s: 2.5 s late
    run = run_logged(logged_pair(host, merging), traced={"x"})
    trace = run.traces["x"]
    logged = min(60, len(trace["host_station_m"]))
    np.testing.assert_allclose(trace["host_station_m"][:logged], host[:logged], atol=1e-6)
    assert trace["host_station_m"].iloc[-1] > host[-1]
    c = {name: column[0] for name, column in run.columns.items()}
    assert c["host_reached_s"] == pytest.approx(4.0)
    assert c["distance_m"] == pytest.approx(10.0)  # the merging car has 1.0 s to go
    assert c["merging_reached_s"] == pytest.approx(5.0)
    assert c["jerk_sum"] == pytest.approx(0.0, abs=1e-3)
    assert c["station_square_sum"] == pytest.approx(0.0, abs=1e-9)
    assert c["last_decision"] == -1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["us101", "i80"])
def test_real_hosts_never_fail_and_keep_the_logs_distance(data_dir, name):
    encounters = site_encounters(data_dir, site(name))
    if encounters is None:
        pytest.skip(f"no recording of {name}")
    assert len(encounters)
    run = run_logged(encounters)
    assert not run.columns["kind"].any()
    for row in range(len(encounters)):
        host, merging = encounters.log.host_station[row], encounters.log.merging_station[row]
        at = np.flatnonzero((host[:-1] < -1e-6) & (host[1:] >= -1e-6))
        if not len(at) or at[0] + 1 >= len(merging):
            continue
        part = -host[at[0]] / (host[at[0] + 1] - host[at[0]])
        there = merging[at[0]] + part * (merging[at[0] + 1] - merging[at[0]])
        assert run.columns["distance_m"][row] == pytest.approx(abs(there), abs=1e-5)

"""What the measures have to do with each other, whatever the cars do."""

import numpy as np
from cases import random_encounters
from hypothesis import example, given, settings
from hypothesis import strategies as st

from merge_cosim.controllers.base import controllers
from merge_cosim.core.observation import Setting
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.results.rows import post_encroachment
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.scoring import KINDS
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.closed_form import ClosedFormWorld


def outcome(seed, method):
    encounters = random_encounters(40, seed)
    driver = HostDriver(estimators[method](), controllers["acc"]())
    run = Loop(ClosedFormWorld(40), encounters, driver, merging_cars["designed"](), Rules(), Setting()).run()
    return encounters, run.columns, post_encroachment(run.columns, encounters, 0.1)


@settings(max_examples=25)
@example(108, "always-yield")  # the host stops with its rear 5 cm past the point
@given(st.integers(0, 10_000), st.sampled_from(["always-go", "always-yield", "slot-time"]))
def test_failure_gap_time_and_encroachment_agree(seed, method):
    encounters, c, pet = outcome(seed, method)
    failed = c["kind"] > 0
    side = c["kind"] == KINDS.index("side")
    assert (c["min_gap_m"][failed] < -1e-6).all()
    assert (c["min_gap_m"][~failed] >= -1e-6).all()
    # who leaves a whole cycle between them meets him at the point only if he has crept less than a step past it
    rears = np.stack([c["end_station"] - encounters.host_length, c["end_merging_station"] - encounters.merging_length])
    step = 0.1 * np.stack([c["end_merging_speed"], c["end_speed"]])
    assert (((rears > 0) & (rears < step)).any(axis=0) | ~(side & (pet > 0.1))).all()
    assert failed[pet < -0.1].all()  # who arrives a whole cycle too early does
    assert (c["min_ttc_s"] >= 0).all()
    assert ((c["max_drac"] > 0) <= np.isfinite(c["min_ttc_s"])).all()
    rear_end = failed & ~side
    assert (np.nan_to_num(pet, nan=1.0)[rear_end] > -0.1).all()


@settings(max_examples=10)
@given(st.integers(0, 10_000))
def test_times_are_in_order(seed):
    _, c, _ = outcome(seed, "slot-time")
    for front, rear in (("host_reached_s", "host_cleared_s"), ("merging_reached_s", "merging_cleared_s")):
        both = ~np.isnan(c[front]) & ~np.isnan(c[rear])
        assert (c[rear][both] > c[front][both]).all()
    decided = c["last_decision"] >= 0
    assert (c["decided_from"][decided] <= c["end_cycle"][decided]).all()
    assert ((c["decision_flips"] == 0) <= (c["decided_from"] == 0)).all()

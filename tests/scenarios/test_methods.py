"""Methods made of names, classes and objects, and what their parameters are."""

import linecache
import pickle
import re
from dataclasses import dataclass

import cloudpickle
import libsumo
import numpy as np
import pytest

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import Controller
from merge_cosim.controllers.pcb import Pcb
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import source_of
from merge_cosim.estimators.base import Estimator
from merge_cosim.estimators.ipcb import Ipcb
from merge_cosim.estimators.pgm import Pgm
from merge_cosim.merging_cars.designed import Designed
from merge_cosim.scenarios.methods import Method
from merge_cosim.scenarios.settings import split_settings
from merge_cosim.sweeps.listener import HostListener


class LeadRule(Estimator):
    """An estimator of no registry, without any decorator."""

    lead: float = 10.0

    def update(self, seen):
        return np.where(seen.host_station - seen.merging_station > self.lead, -1.0, 1.0)


@dataclass(kw_only=True)
class Gentle(Controller):
    """A controller of no registry, which counts its commands."""

    braking: float = -1.0

    def __post_init__(self):
        self.commands = 0

    def command(self, seen, log_odds, target):
        self.commands += 1
        return np.where(target, self.braking, 0.0)


class Fitted(Estimator):
    """An estimator that is given what it needs."""

    def __init__(self, table):
        self.table = table

    def update(self, seen):
        return np.full(len(seen.host_station), self.table["log_odds"])


@pytest.mark.parametrize(
    ("spec", "name", "estimator", "controller"),
    [
        ("pgm", "pgm", "pgm", "acc"),
        ("pgm+lqr", "pgm+lqr", "pgm", "lqr"),
        (Pgm, "pgm", "pgm", "acc"),
        (Ipcb(sigma=1), "ipcb", "ipcb", "pcb"),
        (Pcb, "acc+pcb", "acc", "pcb"),
        (LeadRule, "lead-rule", "lead-rule", "acc"),
        (Gentle(), "acc+gentle", "acc", "gentle"),
        (("pgm", Gentle), "pgm+gentle", "pgm", "gentle"),
        ((LeadRule, "lqr"), "lead-rule+lqr", "lead-rule", "lqr"),
        (Fitted({"log_odds": 2.0}), "fitted", "fitted", "acc"),
    ],
)
def test_what_a_method_is_made_of(spec, name, estimator, controller):
    method = Method.of(spec)
    assert (method.name, method.estimator, method.controller) == (name, estimator, controller)
    sent = pickle.loads(cloudpickle.dumps(method))
    assert sent == method
    assert hash(sent) == hash(method)
    driver = sent.driver(None)
    assert (driver.estimator.name, driver.controller.name) == (estimator, controller)


def test_parameters_are_those_of_the_object_and_settings_override_them():
    given = Gentle(braking=-2.0)
    assert Method.of(("always-go", given)).parameters() == {"gentle.braking": -2.0}
    method = Method.of(("always-go", given), {"gentle.braking": -3, "acc.headway": 1})
    assert method.parameters() == {"gentle.braking": -3.0}
    assert method.driver(None).controller.braking == -3.0
    assert given.braking == -2.0
    assert method != Method.of(("always-go", given))


def test_registered_components_travel_by_name():
    assert Method.of((Pgm(nodes=3), Acc)).objects == (None, None)
    assert Method.of(Pgm(nodes=3)).driver(None).estimator.nodes == 3


def test_no_state_passes_from_one_driver_to_the_next():
    method = Method.of(("always-go", Gentle()))
    first = method.driver(None).controller
    first.commands += 5
    assert method.driver(None).controller.commands == 0


def test_an_object_may_have_a_name_of_its_own():
    given = Gentle(braking=-2.0)
    given.name = "firm"
    method = Method.of(("acc", given), {"firm.braking": -3.0})
    assert (method.name, method.parameters()) == ("acc+firm", {"firm.braking": -3.0})
    assert split_settings({"firm.braking": -3.0}, [given]) == ({}, {"firm.braking": -3.0})


def test_classes_and_their_source():
    assert Method.of("human").classes() == []
    assert Method.of("pgm").classes() == [Pgm, Acc]
    assert [source_of(one).count("class ") for one in Method.of((LeadRule, Gentle)).classes()] == [1, 1]
    cell = "import numpy as np\n\nclass InACell(Estimator):\n    def update(self, seen):\n        return np.zeros(1)\n"
    linecache.cache["<cell 1>"] = (len(cell), None, cell.splitlines(keepends=True), "<cell 1>")
    scope = {"Estimator": Estimator, "__name__": "__main__"}
    exec(compile(cell, "<cell 1>", "exec"), scope)
    assert "class InACell(Estimator)" in source_of(scope["InACell"])
    del linecache.cache["<cell 1>"]
    assert re.fullmatch("# no source at hand; hash of the code: [0-9a-f]{16}", source_of(scope["InACell"]))


class Acceleration(Acc):
    """A controller that calls itself as another does."""

    name = "acc"


@pytest.mark.parametrize(
    ("spec", "line"),
    [
        (5, "int: not an estimator"),
        (Designed, "Designed: not an estimator"),
        (("pgm", LeadRule), "LeadRule: not a controller"),
        (Fitted, "Fitted: give an object instead of the class: .*table"),
        (LeadRule(lead="far"), "LeadRule: lead = 'far'"),
        (("pgm", Acceleration), "the controller name 'acc' is taken by .*Acc; rename yours"),
    ],
)
def test_what_is_no_method_is_refused(spec, line):
    with pytest.raises(UserError, match=line):
        Method.of(spec)


def test_two_components_of_one_name_may_not_share_a_parameter():
    given = LeadRule(lead=3.0)
    given.name = "gentle"
    assert Method.of((given, Gentle)).parameters() == {"gentle.lead": 3.0, "gentle.braking": -1.0}
    twin_class = type("Twin", (Gentle,), {"__annotations__": {"lead": float}, "lead": 1.0, "name": "lead-rule"})
    with pytest.raises(UserError, match="are both 'lead-rule'; rename one of them"):
        Method.of((LeadRule, twin_class))


def test_the_planner_takes_the_intended_accelerations_from_its_estimator():
    both = Method.of("ipcb", {"ipcb.means": "arrival", "ipcb.tau": 2})
    controller = both.driver(None).controller
    assert (controller.means, controller.tau) == ("arrival", 2.0)
    assert both.parameters()["pcb.means"] == "arrival"
    assert Method.of("pgm+pcb", {"ipcb.means": "arrival"}).parameters()["pcb.means"] == "fixed"
    assert Method.of("pgm+pcb", {"pcb.means": "arrival"}).driver(None).controller.means == "arrival"
    assert Method.of("ipcb", {"ipcb.means": "arrival", "pcb.means": "arrival"}) == Method.of(
        "ipcb", {"ipcb.means": "arrival"}
    )
    assert Method.of((Ipcb(means="arrival"), Pcb)).driver(None).controller.means == "arrival"


@pytest.mark.parametrize(
    ("spec", "settings"),
    [
        ("ipcb", {"pcb.means": "arrival"}),
        ("ipcb", {"ipcb.means": "arrival", "pcb.means": "fixed"}),
        (("ipcb", Pcb(means="arrival")), {}),
    ],
)
def test_a_planner_that_disagrees_with_its_estimator_is_refused(spec, settings):
    with pytest.raises(UserError, match=r"pcb\.means = .* disagrees with ipcb\.means = .*; set ipcb\.means"):
        Method.of(spec, settings)


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"acc.headway": 1.0}, r"acc\.headway: no chosen method has this parameter; set lqr\.headway"),
        ({"lqr.headwy": 1.0}, r"lqr\.headwy: no chosen method has this parameter"),
    ],
)
def test_a_listener_refuses_settings_that_reach_nothing(settings, line):
    with pytest.raises(UserError, match=line):
        HostListener(libsumo, "designed", "acc+lqr", settings=settings)

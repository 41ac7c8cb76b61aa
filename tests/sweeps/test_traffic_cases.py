"""Scenes as cases: names, parts, and scenes in which nothing can be measured."""

import numpy as np
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.simulation.worlds.notes import Event
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.traffic_cases import TrafficCases, refuse_empty


def test_a_scene_is_found_by_its_name_and_by_those_of_its_encounters():
    (task,) = plan(SweepRequest(["traffic-light"], ["acc"], settings={"encounters.replications": 5}))
    cases = task.cases
    assert isinstance(cases, TrafficCases)
    assert [cases.name(number) for number in range(len(cases))] == ["000", "001", "002", "003", "004"]
    part = cases.take(np.array([2, 3]))
    assert [part.name(number) for number in range(len(part))] == ["002", "003"]
    assert (part.number("003"), part.number("003/host.1/merging.2"), part.number("000")) == (1, 1, None)


def test_scenes_without_a_meeting_are_refused_with_the_reason():
    refuse_empty([], "here")  # of pairs there are no facts
    refuse_empty([{"meetings": 0, "notes": []}, {"meetings": 1, "notes": []}], "here")
    with pytest.raises(
        UserError, match=r"^here: nothing to measure: hosts and merging cars never came near each other$"
    ):
        refuse_empty([{"meetings": 0, "notes": []}], "here")
    with pytest.raises(UserError, match=r"^here: nothing to measure: no host came$"):
        refuse_empty([{"meetings": 0, "notes": [(str(Event.NO_HOST), "no host came")]}], "here")

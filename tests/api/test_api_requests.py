"""What a Python user hands over, as a request; and a figure of one case."""

import pandas as pd
import pytest

import merge_cosim as mc
from merge_cosim.api.plots import case_figure
from merge_cosim.api.request import request_of

STATES = {"host_station": [-80.0], "host_speed": 20.0, "merging_station": -90.0, "merging_speed": 18.0}


def test_one_of_each_is_as_good_as_a_list():
    one = request_of("designed-2", "acc", vary={"acc.headway": (1.0, 2.0)}, jobs=3)
    assert one == request_of(["designed-2"], ["acc"], vary={"acc.headway": [1.0, 2.0]}, jobs=3)
    assert (one.scenarios, one.variations, one.jobs) == (["designed-2"], [("acc.headway", [1.0, 2.0])], 3)


def test_encounters_need_names_where_there_are_several():
    encounters = mc.Encounters.from_frame(pd.DataFrame(STATES))
    ((scenario, given),) = request_of(encounters, "acc").scenarios
    assert (scenario.name, given) == ("encounters", encounters)
    with pytest.raises(mc.UserError, match="2 batches of encounters need names"):
        request_of([encounters, encounters], "acc")
    with pytest.raises(mc.UserError, match="scenario mine: 5 is neither a Scenario nor Encounters"):
        request_of({"mine": 5}, "acc")


def test_a_case_is_drawn_by_quantities_that_there_are():
    drawn = mc.run("designed-2", case="d+1_h15_m14", method="acc")
    traces = drawn.trace.assign(method="acc")
    assert len(case_figure(traces, {"acc": False}, "speed").axes) >= 1
    with pytest.raises(mc.UserError, match="plot: no quantity 'sped'; did you mean 'speed'"):
        case_figure(traces, {"acc": False}, "sped")

"""What there is, as tables."""

import merge_cosim as mc


def test_lists():
    methods = mc.list_methods().set_index("name")
    assert methods.loc["pgm", "role"] == "estimator"
    assert {"designed-1", "us101-replay"} <= set(mc.list_scenarios()["scenario"])
    assert set(mc.list_models()["model"]) == {"us101-ngsim", "us101-ngsim-all", "us101-surrogate"}
    assert set(mc.list_ramps()["name"]) == {"designed", "i80", "us101"}

"""Living traffic as SUMO files."""

from lxml import etree

from merge_cosim.ramps.ramp import Ramp
from merge_cosim.sumo.demand import Demand, write_traffic


def flows(file):
    return {flow.get("id"): flow for flow in etree.parse(file.parent / "traffic.rou.xml").getroot().iter("flow")}


def test_flows_have_the_demand_asked_for(tmp_path):
    demand = Demand(through=3600, leaving=0, merging=720, hosts=180, warm_up=30, car_following="IDM")
    file = write_traffic(tmp_path, demand, Ramp.load("us101"))
    found = flows(file)
    assert set(found) == {"through", "merging", "host"}
    assert found["through"].get("period") == "exp(1.0)"
    assert found["merging"].get("period") == "5.0"
    assert float(found["host"].get("begin")) == 30.0
    assert found["host"].get("departLane") == "0"
    assert found["merging"].find("route").get("edges") == "ramp weave main_out"
    types = list(etree.parse(tmp_path / "traffic.rou.xml").getroot().iter("vType"))
    roles = {kind.get("id").partition("-")[0]: [one.get("value") for one in kind.iter("param")] for kind in types}
    assert roles == {"host": ["host"], "through": [], "merging": ["merging"]}
    assert {kind.get("carFollowModel") for kind in types[1:]} == {"IDM"}
    assert not (tmp_path / "traffic.add.xml").read_text().count("variableSpeedSign")


def test_copies_have_flows_each_in_the_order_of_time(tmp_path):
    found = flows(write_traffic(tmp_path, Demand(copies=2), Ramp.load("us101")))
    assert {name.partition(".")[0] for name in found} == {"t0", "t1"}
    begins = [float(flow.get("begin")) for flow in found.values()]
    assert begins == sorted(begins)  # SUMO reads a route file only as far as it has come in time
    assert found["t1.leaving"].find("route").get("edges") == "t1.main_in t1.weave t1.exit"


def test_waves_are_signs_past_the_ramp(tmp_path):
    demand = Demand(duration=100, wave_every=40, wave_lasts=10, wave_speed=2, ramp_speed=15)
    write_traffic(tmp_path, demand, Ramp.load("us101"))
    signs = {sign.get("lanes"): sign for sign in etree.parse(tmp_path / "traffic.add.xml").getroot()}
    assert set(signs) == {"ramp_0", *(f"main_out_{lane}" for lane in range(5))}
    steps = [(float(step.get("time")), float(step.get("speed"))) for step in signs["main_out_0"]]
    assert steps == [(0, 29), (40, 2), (50, 29), (80, 2), (90, 29)]


def test_sublanes_only_for_the_model_that_needs_them(tmp_path):
    for model, expected in (("LC2013", False), ("SL2015", True)):
        file = write_traffic(tmp_path / model, Demand(lane_changing=model), Ramp.load("us101"))
        assert ("lateral-resolution" in file.read_text()) is expected

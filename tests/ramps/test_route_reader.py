"""Encounters from route files: what was written comes back, a user's own file runs, mistakes are named."""

import numpy as np
import pytest

from merge_cosim.encounter import Encounters
from merge_cosim.errors import UserError
from merge_cosim.ramps.new import RampNumbers, new_ramp
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.route_reader import read_sumocfg
from merge_cosim.ramps.routes import write_encounter

ROUTES = """<routes>
  <vType id="auto" length="4.6"><param key="merge-cosim.role" value="host"/></vType>
  <vType id="human"><param key="merge-cosim.role" value="merging"/></vType>
  <vType id="other"/>
  <route id="through" edges="main_in main_out"/>
  <vehicle id="h0" type="auto" route="through" depart="0" departPos="405" departSpeed="20"/>
  <vehicle id="m0" type="human" depart="0" departPos="410" departSpeed="18"><route edges="ramp main_out"/></vehicle>
  <vehicle id="bystander" type="other" route="through" depart="0"/>
</routes>
"""
CONFIG = """<configuration>
<input><net-file value="mine/designed.net.xml"/><route-files value="my.rou.xml"/></input>
</configuration>
"""


def write(folder, routes=ROUTES, config=CONFIG):
    ramp = new_ramp(folder / "mine", RampNumbers())
    (folder / "my.rou.xml").write_text(routes)
    file = folder / "my.sumocfg"
    file.write_text(config.replace("designed.net.xml", Ramp.load(ramp).net.name))
    return file


def test_what_was_written_is_read_again(tmp_path):
    ramp = Ramp.load("us101")
    text, none = np.array(["one"]), np.zeros(1, dtype=bool)
    numbers = (np.array([value]) for value in (-95.0, 21.5, 4.5, -12.0, 17.25, 6.0, 33.0))
    original = Encounters(text, text, text, text, *numbers, np.array([-1]), none, none)
    _, again = read_sumocfg(write_encounter(tmp_path / "case", ramp, original, 0))
    for name in ("host_station", "host_speed", "host_length", "merging_station", "merging_speed", "merging_length"):
        np.testing.assert_allclose(getattr(again, name), getattr(original, name), atol=1e-9, err_msg=name)
    assert again.merge_position[0] == 33.0


def test_a_file_of_ones_own(tmp_path):
    ramp, encounters = read_sumocfg(write(tmp_path))
    assert ramp.name == "mine"
    assert encounters.case.tolist() == ["h0_m0"]
    assert (encounters.host_station[0], encounters.merging_station[0]) == (-95.0, -90.0)
    assert (encounters.host_length[0], encounters.merging_length[0]) == (4.6, 5.0)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('value="merging"', 'value="mergin"', r"my\.rou\.xml:7: vehicle 'm0': .*'mergin'"),
        ('departPos="405"', 'departPos="base"', r"vehicle 'h0': departPos is 'base'"),
        ('departSpeed="20"', 'departSpeed="nan"', r"departSpeed"),
        ('departSpeed="20"', "", r"departSpeed is ''"),
        ('edges="ramp main_out"', 'edges="nowhere main_out"', r"vehicle 'm0': .*'nowhere'"),
        ('type="human" depart', 'type="auto" depart', r"2 cars with the role host and 0"),
        ("</routes>", "", r"my\.rou\.xml: not XML"),
    ],
)
def test_mistakes_in_routes_are_named(tmp_path, old, new, expected):
    assert old in ROUTES
    with pytest.raises(UserError, match=expected):
        read_sumocfg(write(tmp_path, ROUTES.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("my.rou.xml", "other.rou.xml", r"other\.rou\.xml: no such file"),
        ("net-file", "net-fil", r"my\.sumocfg: no <net-file"),
        ("mine/", "", r"no ramp\.toml beside its net"),
    ],
)
def test_mistakes_in_the_configuration_are_named(tmp_path, old, new, expected):
    with pytest.raises(UserError, match=expected):
        read_sumocfg(write(tmp_path, config=CONFIG.replace(old, new)))

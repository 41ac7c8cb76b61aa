"""Encounters from route files: what was written comes back, a user's own file runs, mistakes are named."""

import gzip
import math
import shutil

import numpy as np
import pytest

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.files import cache_folder, from_cache
from merge_cosim.ramps.build import build
from merge_cosim.ramps.create.new import RampNumbers, new_ramp
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scenarios.scenario import load_scenario
from merge_cosim.sumo.configuration import Configuration
from merge_cosim.sumo.route_reader import only_pairs, read_sumocfg
from merge_cosim.sumo.routes import write_encounter

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

BOMB = (
    '<!DOCTYPE c [<!ENTITY a "0123456789">'
    + "".join(f'<!ENTITY {chr(b + 1)} "{f"&{chr(b)};" * 10}">' for b in range(97, 107))
    + ']><configuration a="&k;">'
)
"""An attribute of 100 GB."""


def write(folder, routes=ROUTES, config=CONFIG):
    made = from_cache(cache_folder("tests") / "mine", lambda place: new_ramp(place, RampNumbers()))
    ramp = shutil.copytree(made, folder / "mine")
    (folder / "my.rou.xml").write_text(routes)
    file = folder / "my.sumocfg"
    file.write_text(config.replace("designed.net.xml", Ramp.load(ramp).net.name))
    return file


@pytest.mark.parametrize("host", ["main", "ramp"])
def test_what_was_written_is_read_again(tmp_path, host):
    ramp = Ramp.load("us101")
    text, none = np.array(["one"]), np.zeros(1, dtype=bool)
    numbers = (np.array([value]) for value in (-95.0, 21.5, 4.5, -12.0, 17.25, 6.0, 33.0))
    original = Encounters(text, text, text, text, *numbers, np.array([-1]), none, none)
    _, again = read_sumocfg(write_encounter(tmp_path / "case", ramp, original, 0, host), host)
    for name in ("host_station", "host_speed", "host_length", "merging_station", "merging_speed", "merging_length"):
        np.testing.assert_allclose(getattr(again, name), getattr(original, name), atol=1e-9, err_msg=name)
    assert again.merge_position[0] == 33.0


def test_a_file_of_ones_own(tmp_path):
    ramp, encounters = read_sumocfg(write(tmp_path))
    assert ramp.name == "mine"
    assert encounters.case.tolist() == ["h0_m0"]
    assert (encounters.host_station[0], encounters.merging_station[0]) == (-95.0, -90.0)
    assert (encounters.host_length[0], encounters.merging_length[0]) == (4.6, 5.0)


def test_types_and_routes_in_any_of_the_files(tmp_path):
    """As SUMO reads them: the parameter of a vehicle of SUMO's own type, a position from the edge's end."""
    (tmp_path / "types.add.xml").write_text(
        '<add><vType id="human" length="7"/><route id="up" edges="ramp main_out"/></add>'
    )
    routes = """<routes>
      <vehicle id="h" depart="0" departPos="-95" departSpeed="20"><route edges="main_in main_out"/>
      <param key="merge-cosim.role" value="host"/></vehicle>
      <vehicle id="m" type="human" route="up" depart="0" departPos="410" departSpeed="18">
      <param key="merge-cosim.role" value="merging"/></vehicle></routes>"""
    more = '<additional-files value="types.add.xml"/></input>'
    _, encounters = read_sumocfg(write(tmp_path, routes, CONFIG.replace("</input>", more)))
    assert (encounters.host_station[0], encounters.merging_station[0]) == (-95.0, -90.0)
    assert (encounters.host_length[0], encounters.merging_length[0]) == (5.0, 7.0)


def test_two_encounters_of_one_name_are_refused(tmp_path):
    twice = "".join(f"{line}\n" * (2 if "departPos" in line else 1) for line in ROUTES.splitlines())
    with pytest.raises(UserError, match=r"my\.sumocfg: two encounters are called 'h0_m0'"):
        read_sumocfg(write(tmp_path, twice))


def test_cars_that_depart_at_other_times_are_no_pair(tmp_path):
    alone = ROUTES.replace('<vehicle id="bystander" type="other" route="through" depart="0"/>', "")
    file = write(tmp_path)
    for routes, expected in ((alone, True), (alone.replace('depart="0"', 'depart="9"', 1), False), (ROUTES, False)):
        (tmp_path / "my.rou.xml").write_text(routes)
        assert only_pairs(Configuration.read(file)) == expected


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('value="merging"', 'value="mergin"', r"my\.rou\.xml:7: vehicle 'm0': .*'mergin'"),
        ('departPos="405"', 'departPos="base"', r"vehicle 'h0': departPos is 'base'"),
        ('departSpeed="20"', 'departSpeed="nan"', r"departSpeed"),
        ('departSpeed="20"', "", r"departSpeed is ''"),
        ('edges="ramp main_out"', 'edges="nowhere main_out"', r"vehicle 'm0': its route is 'nowhere main_out'"),
        ('type="human" depart', 'type="auto" depart', r"2 cars with the role host and 0"),
        ("</routes>", "", r"my\.rou\.xml: not XML"),
        # Without a route it had that of m0, whose own has no id, either.
        ('type="auto" route="through"', 'type="auto"', r"my\.rou\.xml:6: vehicle 'h0': it has no route"),
        ('type="auto" route="through"', 'type="auto" route="thru"', r"'h0': no route with edges is called 'thru'"),
        (
            'edges="ramp main_out"',
            'edges="main_in main_out"',
            r"'m0': its route is 'main_in main_out'; a merging car co",
        ),
        ('edges="ramp main_out"', 'edges="ramp main_in"', r"'m0': its route is 'ramp main_in'; a merging car comes ov"),
        ('id="through" edges="main_in', 'id="through" edges="ramp', r"'h0': its route is 'ramp main_out'; a host car"),
        ('departPos="405"', 'departPos="4050"', r"'h0': departPos is 4050; 'main_in' is 500 m long"),
        ('departPos="405"', 'departPos="405" departLane="3"', r"'h0': departLane is 3; on 'main_in' the host's lane i"),
        ('departSpeed="20"', 'departSpeed="-20"', r"'h0': departSpeed is -20; it must be at least 0"),
        ('length="4.6"', 'length="0"', r"'h0': length is 0; it must be at least 0.1"),
    ],
)
def test_mistakes_in_routes_are_named(tmp_path, old, new, expected):
    assert old in ROUTES
    with pytest.raises(UserError, match=expected):
        read_sumocfg(write(tmp_path, ROUTES.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("my.rou.xml", "other.rou.xml", r"my\.sumocfg: .*other\.rou\.xml: no such file"),
        ("net-file", "net-fil", r"my\.sumocfg: SUMO cannot read it: No option with the name 'net-fil' exists"),
        ('<net-file value="mine/designed.net.xml"/>', "", r"my\.sumocfg: no <net-file"),
        ("</configuration>", "", r"my\.sumocfg: not XML: Premature end of data"),
        ("</input>", '<mesosim value="true"/></input>', r"mesosim"),
        ("</input>", '<end value="soon"/></input>', r"my\.sumocfg: 'soon' is no time"),
        ("</input>", '<step-length value="é"/></input>', r"my\.sumocfg: 'é' is no time"),
        ("<configuration>", BOMB, r"my\.sumocfg: it has a document type"),
    ],
)
def test_mistakes_in_the_configuration_are_named(tmp_path, old, new, expected):
    assert old in CONFIG
    with pytest.raises(UserError, match=expected):
        read_sumocfg(write(tmp_path, config=CONFIG.replace(old, new)))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ('<step-length value="0.25"/>', "step-length 0.25 s is not used: a cycle is 0.1 s"),
        ('<step-length value="0.1"/>', ""),
        ("", "step-length 1 s (SUMO's default) is not used: a cycle is 0.1 s"),
    ],
)
def test_another_step_is_not_taken_silently(tmp_path, given, said, capsys):
    file = write(tmp_path, config=CONFIG.replace("</input>", f"{given}</input>"))
    load_scenario(file)
    assert capsys.readouterr().err == (f"{file}: {said}\n" if said else "")


def test_document_types_and_circles_in_further_files(tmp_path):
    file = write(tmp_path, BOMB.replace("configuration", "routes") + "</routes>")
    with pytest.raises(UserError, match=r"my\.rou\.xml: it has a document type"):
        read_sumocfg(file)
    (tmp_path / "my.rou.xml").write_text('<routes><include href="my.rou.xml"/></routes>')
    with pytest.raises(UserError, match=r"my\.rou\.xml: it includes itself"):
        read_sumocfg(file)
    net = tmp_path / "mine" / "mine.net.xml"
    net.write_text(BOMB.replace("configuration", "net") + "</net>")
    with pytest.raises(UserError, match=r"mine\.net\.xml: it has a document type"):
        Ramp.load(tmp_path / "mine")
    nodes = tmp_path / "mine" / "mine.nod.xml"
    nodes.write_text(BOMB.replace("configuration", "nodes") + "</nodes>")
    with pytest.raises(UserError, match=r"mine\.nod\.xml: it has a document type"):
        build(tmp_path / "mine")


def test_a_net_without_a_ramp_says_how_to_get_one(tmp_path):
    file = write(tmp_path)
    (tmp_path / "mine" / "ramp.toml").unlink()
    with pytest.raises(UserError, match=r"no ramp\.toml beside its net .*mine/mine\.net\.xml"):
        Configuration.read(file)


def test_a_ramp_file_of_another_net_is_refused(tmp_path):
    file = write(tmp_path)
    net = tmp_path / "mine" / "mine.net.xml"
    (tmp_path / "mine" / "other.net.xml").write_bytes(net.read_bytes())
    file.write_text(file.read_text().replace("mine.net.xml", "other.net.xml"))
    with pytest.raises(UserError, match=r"is that of mine\.net\.xml, not of the net other\.net\.xml"):
        Configuration.read(file)


def test_options_by_any_of_sumos_names(tmp_path, monkeypatch):
    """Short names, times of day, spaces, variables of the environment, compressed files, files that include others."""
    write(tmp_path)
    monkeypatch.setenv("WHERE", "demand")
    demand = tmp_path / "demand"
    demand.mkdir()
    (demand / "one.rou.xml.gz").write_bytes(gzip.compress(b'<routes><include href="two.rou.xml"/></routes>'))
    (demand / "two.rou.xml").write_text('<routes><flow id="f" type="t" end="1"/></routes>')
    (demand / "types.add.xml").write_text(
        '<add><vType id="t"/><vTypeDistribution id="d" vTypes="t u"/><vType id="u"/></add>'
    )
    file = tmp_path / "short.sumocfg"
    file.write_text(
        f'<sumoConfiguration><n value="{tmp_path}/mine/mine.net.xml"/><b value="7:00:00"/>'
        '<time><e value="1:7:0:0"/></time>'
        '<routes value="my.rou.xml , ${WHERE}/one.rou.xml.gz"/><additional value="demand/types.add.xml"/>'
        "</sumoConfiguration>"
    )
    found = Configuration.read(file)
    assert found.net == tmp_path / "mine" / "mine.net.xml"
    assert found.routes == (tmp_path / "my.rou.xml", demand / "one.rou.xml.gz")
    assert (found.begin, found.end) == (7 * 3600.0, 31 * 3600.0)
    assert [one.get("id") for one in found.vehicles()] == ["h0", "m0", "bystander", "f"]
    assert found.names_role("host")
    for known in ("f", "f.7", "t", "bystander", "DEFAULT_VEHTYPE"):
        found.require(known)
    with pytest.raises(UserError, match=r"host = 'd': it stands for several types; choose one: t, u"):
        found.require("d")
    with pytest.raises(UserError, match=r"no vehicle, flow or type of its files has this id.*choose from: .*f, human"):
        found.require("nobody")


def test_times_that_a_configuration_leaves_open(tmp_path):
    found = Configuration.read(write(tmp_path))
    assert (found.begin, found.end) == (0.0, math.inf)

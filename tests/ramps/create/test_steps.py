"""The steps from a net to a ramp of one's own, one by one, on one of SUMO's example nets."""

from pathlib import Path

import pytest
import sumo
from lxml import etree

from merge_cosim.core.errors import UserError
from merge_cosim.core.files import shipped
from merge_cosim.ramps.create.folder import definition_text, document, require_new
from merge_cosim.ramps.create.layout import lay_out, nodes
from merge_cosim.ramps.create.onramp import Origin, choose, read_source, sources_of, title_of
from merge_cosim.ramps.create.plain import PlainXml
from merge_cosim.ramps.create.start import found
from merge_cosim.ramps.definition import FILE_NAME, read_ramp_file
from merge_cosim.ramps.infer import course, joint_of, joints
from merge_cosim.ramps.paths import is_link

GAME = Path(sumo.SUMO_HOME) / "tools" / "game" / "ramp" / "ramp.net.xml"


@pytest.fixture(scope="module")
def net():
    return read_source(GAME, GAME)


def test_the_on_ramp_is_found_and_followed(net):
    (joint,) = joints(net)
    assert joint_of(net, joint.link.getID()) == joint
    path = course(joint, 300.0, 300.0)
    assert choose(net, None, 300.0, 300.0) == (joint, path)
    assert {lane.getEdge().getID() for lane in path.beside}
    assert not is_link(path.beside[0].getEdge())
    assert title_of(joint, "mine").startswith("mine")
    assert set(sources_of(joint, path, 100.0, 30.0, Origin(GAME), None)) >= {"ramp", "speed_limit"}


def test_the_layout_begins_at_the_gore_and_is_written_as_plain_xml(net):
    _, path = choose(net, None, 300.0, 300.0)
    layout = lay_out(path, 300.0, 300.0)
    placed = nodes(layout.roads)
    assert placed[layout.main[layout.gore].start].place[0] == pytest.approx(0.0, abs=1e-6)
    assert sum(road.length for road in layout.main[: layout.gore]) == pytest.approx(300.0)
    plain = PlainXml(net, path, layout, 25.0, raised=False)
    written = [etree.fromstring(text.encode()) for text in (plain.nodes(), plain.edges(), plain.connections())]
    assert {one.get("id") for one in written[0].iter("node")} == set(placed)
    ends = {edge.get("id"): (edge.get("from"), edge.get("to")) for edge in written[1].iter("edge")}
    assert len(ends) == len(layout.roads)
    assert {node for pair in ends.values() for node in pair} == set(placed)
    assert {one.get("from") for one in written[2].iter("connection")} <= set(ends)


def test_a_new_folder_has_a_plain_name_and_nothing_in_it(tmp_path):
    require_new(tmp_path / "mine")
    with pytest.raises(UserError, match="'mi ne' is no name for a ramp"):
        require_new(tmp_path / "mi ne")
    (tmp_path / "taken").mkdir()
    require_new(tmp_path / "taken")
    (tmp_path / "taken" / "file").touch()
    with pytest.raises(UserError, match="taken: exists already"):
        require_new(tmp_path / "taken")


def test_a_definition_is_read_back_as_it_was_written(tmp_path):
    file = read_ramp_file(shipped("sumo_nets") / "designed")
    (tmp_path / FILE_NAME).write_text(definition_text(file), encoding="utf-8")
    assert read_ramp_file(tmp_path) == file
    assert found(tmp_path)[0] == f"main road: {' '.join(file.main)}, host's lanes {' '.join(map(str, file.host_lane))}"


def test_a_document_is_xml_with_its_rows():
    root = etree.fromstring(document("nodes", "by hand", ['<node id="a"/>', '<node id="b"/>']).encode())
    assert (root.tag, [one.get("id") for one in root.iter("node")]) == ("nodes", ["a", "b"])

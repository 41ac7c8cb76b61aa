"""Somebody's own net, described in place."""

import gzip
import json
from pathlib import Path

import pytest
import sumo
import sumolib
from command import merge_cosim

from merge_cosim.core.errors import UserError
from merge_cosim.ramps.check import check
from merge_cosim.ramps.create.describe import describe_ramp
from merge_cosim.ramps.definition import read_ramp_file
from merge_cosim.ramps.ramp import Ramp

GAMES = Path(sumo.SUMO_HOME) / "tools" / "game"
A10 = GAMES / "A10KW" / "osm.net.xml"


def copied(net: Path, folder: Path) -> Path:
    target = folder / net.name
    target.write_bytes(net.read_bytes())
    return target


def test_a_real_interchange_is_described_and_not_touched(tmp_path: Path) -> None:
    """The A10 near Koenigs Wusterhausen; its edges by their own names, with their own lengths."""
    net = copied(A10, tmp_path)
    assert describe_ramp(net, "24498409") == tmp_path
    assert net.read_bytes() == A10.read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["osm.net.xml", "ramp.png", "ramp.toml"]
    assert check(tmp_path) == []
    file, ramp = read_ramp_file(tmp_path), Ramp.load(tmp_path)
    assert file.described
    assert ramp.main_route == ("264306385", "264308375", "264308383", "4054057", "264308376")
    assert [section.lane for section in ramp.main] == [0, 1, 0, 1, 0]
    assert ramp.ramp_route[:2] == ("24498409", "4054057")
    assert ramp.auxiliary_end == sumolib.net.readNet(str(A10)).getEdge("4054057").getLength()
    assert (file.gore, file.merging_point, file.speed_limit) == ("4054057", 39.0, 27.78)
    assert "Südlicher Berliner Ring" in file.title


def test_what_encounters_need_is_a_note_only(tmp_path: Path) -> None:
    net = copied(GAMES / "ramp" / "ramp.net.xml", tmp_path)
    done = merge_cosim("ramp", "describe", net.name, "--json", cwd=tmp_path)
    found = json.loads(done.stdout)
    assert found["problems"] == []
    assert any("219 m upstream of the gore" in note for note in found["notes"])
    assert found["found"][0] == "main road: gneE2 offramp gneE3 gneE7 gneE8 gneE11, host's lanes 1 1 0 1 0 0"
    assert not any("netccfg" in note for note in found["notes"])
    checked = merge_cosim("ramp", "check", ".", cwd=tmp_path)
    assert checked.returncode == 0
    assert "no problem found" in checked.stdout


def test_a_compressed_net_and_another_limit(tmp_path: Path) -> None:
    net = tmp_path / "ramp.net.xml.gz"
    net.write_bytes(gzip.compress((GAMES / "ramp" / "ramp.net.xml").read_bytes()))
    describe_ramp(net, speed_limit=30.0)
    ramp = Ramp.load(tmp_path)
    assert (ramp.net, ramp.speed_limit) == (net, 30.0)
    assert read_ramp_file(tmp_path).sources["speed_limit"] == "Given to merge-cosim ramp describe."


def test_what_cannot_be_described_is_one_line(tmp_path: Path) -> None:
    net = copied(A10, tmp_path)
    with pytest.raises(UserError, match=r"osm\.net\.xml: 2 on-ramps; choose one with --link: 308396220 .*, 24498409 "):
        describe_ramp(net)
    with pytest.raises(UserError, match="no edge 'nowhere'"):
        describe_ramp(net, "nowhere")
    (tmp_path / "ramp.toml").write_text("mine")
    with pytest.raises(UserError, match=r"ramp\.toml: exists already"):
        describe_ramp(net, "24498409")
    assert (tmp_path / "ramp.toml").read_text() == "mine"
    net.write_bytes(net.read_bytes()[:5000])
    with pytest.raises(UserError, match=r"osm\.net\.xml: not a SUMO net"):
        describe_ramp(net, "24498409")

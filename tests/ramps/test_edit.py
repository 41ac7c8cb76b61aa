import os
import time
from pathlib import Path

import pytest
from test_ramp import NAMES, copy_with

from merge_cosim.ramps.build import build, config, netconvert
from merge_cosim.ramps.create.from_osm import ramp_from_osm
from merge_cosim.ramps.edit import take_over_net

EXTRACT = Path(__file__).parents[2] / "docs" / "files" / "rosenbach.osm"


def test_a_net_that_was_saved_alone_becomes_plain_xml(tmp_path: Path) -> None:
    folder = copy_with(tmp_path, "title", "title", "us101")
    edges, started = folder / "us101.edg.xml", time.time_ns()
    before = edges.read_text()
    edges.write_text(before.replace('speed="29.00"', 'speed="27.00"', 1))
    saved = build(folder).read_bytes()
    edges.write_text(before)
    assert not take_over_net(folder, started), "the plain XML was saved last"
    (folder / "us101.net.xml").write_bytes(saved)
    later = time.time_ns() + 10**9
    os.utime(folder / "us101.net.xml", ns=(later, later))
    assert not take_over_net(folder, later), "nothing was saved since"
    assert take_over_net(folder, started)
    assert build(folder).read_bytes() == saved, "georeference, lengths, shapes and parameters are kept"


@pytest.mark.parametrize("name", [*NAMES, "mapped"])
def test_plain_xml_that_sumo_has_written_builds_the_same_net(tmp_path: Path, name: str) -> None:
    # What netedit's Save Plain XML does: read the sources, and write them anew over themselves.
    if name == "mapped":
        extract = tmp_path / "extract.osm"
        extract.write_text(EXTRACT.read_text(encoding="utf-8").replace('"ref"', '"name"'), encoding="utf-8")
        folder = ramp_from_osm(tmp_path / name, extract)
    else:
        folder = copy_with(tmp_path, "title", "title", name)
    before = (folder / f"{name}.net.xml").read_bytes()
    files = ("--output-file", str(tmp_path / "net.xml"), "--plain-output-prefix", str(folder / name))
    netconvert(folder, "-c", str(config(folder)), *files)
    assert b"generated on" in (folder / f"{name}.edg.xml").read_bytes()
    assert build(folder).read_bytes() == before

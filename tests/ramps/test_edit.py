import os
import time
from pathlib import Path

from test_ramp import copy_with

from merge_cosim.ramps.build import build
from merge_cosim.ramps.edit import take_over_net


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

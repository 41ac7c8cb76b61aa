"""Options of SUMO's own outputs; tests/cli/test_outputs.py compares what it writes."""

import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.sumo.outputs import SumoOutputs


def test_nothing_wanted_needs_no_option():
    assert not SumoOutputs().wanted
    assert SumoOutputs().prepare() == ()


def test_wanted_files_are_made_with_their_folders(tmp_path):
    fcd, trips = tmp_path / "new" / "fcd.xml", tmp_path / "trips.xml"
    outputs = SumoOutputs(fcd=fcd, tripinfo=trips)
    assert outputs.wanted
    options = outputs.prepare()
    assert options[:2] == ("--fcd-output", str(fcd))
    assert options[options.index("--tripinfo-output") + 1] == str(trips)
    assert options[-2:] == ("--precision", "6")
    assert (fcd.read_bytes(), trips.read_bytes()) == (b"", b"")


def test_two_outputs_to_one_file_are_refused(tmp_path):
    with pytest.raises(UserError, match="two of SUMO's outputs"):
        SumoOutputs(fcd=tmp_path / "a.xml", ssm=tmp_path / "." / "a.xml").prepare()
    assert not any(tmp_path.iterdir())

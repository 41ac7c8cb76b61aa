"""Sweeps and runs refuse a ramp that does not pass `ramp check`, unless that is asked for."""

import shutil

import pytest
from command import SMALL, merge_cosim

from merge_cosim.ramps.definition import FILE_NAME
from merge_cosim.ramps.ramp import find_ramp

SWEEP = ("sweep", "small.toml", "--world", "closed-form", "--method", "acc", "--out", "out", "--overwrite")
RUN = ("run", "small.toml", "--world", "closed-form", "--method", "acc", "--case", "d+0_h25_m25")


@pytest.mark.parametrize("words", [SWEEP, RUN])
def test_a_ramp_that_does_not_pass_its_check(tmp_path, words):
    shutil.copytree(find_ramp("designed"), tmp_path / "own")
    (tmp_path / "small.toml").write_text(SMALL.replace('"designed"', '"own"', 1))
    file = tmp_path / "own" / FILE_NAME
    sound = file.read_text()
    assert merge_cosim(*words, cwd=tmp_path).returncode == 0
    file.write_text(sound.replace("speed_limit = 29.0", "speed_limit = 31.0"))
    assert file.read_text() != sound
    done = merge_cosim(*words, cwd=tmp_path)
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    assert line.startswith("merge-cosim: own/ramp.toml: speed_limit: ")
    assert line.endswith("see merge-cosim ramp check own; --unchecked-ramp runs it all the same")
    assert merge_cosim(*words, "--unchecked-ramp", cwd=tmp_path).returncode == 0
    file.write_text(sound)
    assert merge_cosim(*words, cwd=tmp_path).returncode == 0

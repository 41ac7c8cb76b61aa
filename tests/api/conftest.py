"""One small sweep for all tests of the face."""

import pytest

import merge_cosim as mc

COARSE = {
    "encounters.host_speed.step": 8,
    "encounters.merging_speed.step": 8,
    "encounters.host_offset.step": 5,
}


@pytest.fixture(scope="session")
def results():
    return mc.sweep(["designed-2"], methods=["acc", "pgm"], settings=COARSE, jobs=1)

"""Full-scene replay through the real command line, on the surrogate."""

import json

import pytest
from command import merge_cosim
from lxml import etree

CASE = "surrogate_1-112.1-h106.1"


def run(tmp_path, scenario, *more):
    done = merge_cosim(
        "run", scenario, "--source", "surrogate", "--case", CASE, "--method", "pgm", "--json", *more, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_case_runs_alone_among_the_cars_of_its_recording(tmp_path):
    row = run(tmp_path, "us101-scene", "--trace", "trace.csv", "--fcd", "fcd.xml", "--lanechange", "lc.xml")
    alone = run(tmp_path, "us101-replay", "--trace", "alone.csv")
    assert (row["scenario"], row["case"], row["source"]) == ("us101-scene", CASE, "surrogate")
    assert (row["label"], row["model"]) == (alone["label"], alone["model"])
    assert row["min_leader_gap_m"] is not None
    assert alone["min_leader_gap_m"] is None
    first = [(tmp_path / name).read_text().splitlines()[1].split(",") for name in ("trace.csv", "alone.csv")]
    state_and_belief = (0, 1, 2, 4, 5, 6, 7)  # all but the acceleration, which may be the leader's
    assert [first[0][k] for k in state_and_belief] == [first[1][k] for k in state_and_belief]
    cars = [len(step) for step in etree.parse(str(tmp_path / "fcd.xml")).getroot()]
    assert min(cars) > 10
    assert "106.1" in (tmp_path / "fcd.xml").read_text()
    assert '"112.1"' in (tmp_path / "lc.xml").read_text()
    deaf = run(tmp_path, "us101-scene", "--set", "full_scene.heed_leader=false")
    assert deaf["distance_m"] == pytest.approx(alone["distance_m"], abs=1e-6)
    assert deaf["delay_s"] == pytest.approx(alone["delay_s"], abs=1e-6)


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (("--attach", "localhost:8813"), "--attach: not with full_scene"),
        (("--set", "full_scene.drivers.car_following=Nobody"), "full_scene.drivers.car_following = 'Nobody'"),
        (("--set", "encounters.merge_point=site"), "full_scene needs encounters.merge_point"),
    ],
)
def test_mistakes_are_one_line(tmp_path, more, line):
    options = ("--source", "surrogate", "--case", CASE, "--method", "acc")
    done = merge_cosim("run", "us101-scene", *options, *more, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert line in done.stderr

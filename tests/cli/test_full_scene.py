"""Full-scene replay through the real command line, on the surrogate."""

import csv
import json

import pytest
from command import merge_cosim, refused
from lxml import etree
from scene_files import small_scene

from merge_cosim.core.files import shipped

CASE = "surrogate_1-112.1-h106.1"
METHOD = ("--method", "pgm", "--model", "us101-ngsim")  # the surrogate's own model has seen some of the tests' few cars


def run(tmp_path, scenario, *more):
    done = merge_cosim("run", scenario, "--source", "surrogate", "--case", CASE, *METHOD, "--json", *more, cwd=tmp_path)
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
    without_leader = run(tmp_path, "us101-scene", "--set", "full_scene.heed_leader=false")
    assert without_leader["distance_m"] == pytest.approx(alone["distance_m"], abs=1e-6)
    assert without_leader["delay_s"] == pytest.approx(alone["delay_s"], abs=1e-6)


@pytest.mark.slow
def test_a_sweep_with_living_traffic_beside_it_and_its_report(tmp_path):
    (tmp_path / "few.toml").write_text(
        (shipped("scenarios") / "us101-scene.toml").read_text().replace("[encounters]", "[encounters]\nfraction = 0.9")
    )
    small_scene(tmp_path)
    how = ("few.toml", "minute.toml", "--source", "surrogate", "--method", "acc")
    done = merge_cosim("sweep", *how, "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with (tmp_path / "out/traffic.csv").open(newline="") as lines:
        logged, living = csv.DictReader(lines)
    assert float(logged["cars"]) > 10
    assert (logged["hosts"], logged["throughput_veh_h"]) == ("", "")  # they are not counted
    assert (living["cars"], living["released"]) == ("", "")
    assert float(living["hosts"]) > 0
    report = merge_cosim("report", "out", cwd=tmp_path)
    assert report.returncode == 0, report.stderr
    assert "drove into a host" in (tmp_path / "out/report.html").read_text()


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (("--attach", "localhost:8813"), "--attach: not with full_scene"),
        (("--set", "full_scene.drivers.car_following=Nobody"), "full_scene.drivers.car_following = 'Nobody'"),
        (("--set", "encounters.merge_point=site"), "full_scene needs encounters.merge_point"),
        (("--set", "encounters.fraction=0.99"), "us101-scene: no encounter is left to run; lower encounters.fraction"),
    ],
)
def test_mistakes_are_one_line(tmp_path, more, line):
    options = ("--source", "surrogate", "--case", CASE, "--method", "acc")
    assert line in refused("run", "us101-scene", *options, *more, cwd=tmp_path)

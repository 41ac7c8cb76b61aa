"""Videos and stills: the cars lie where the record says, and every cycle is a frame."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageSequence

import merge_cosim as mc
from merge_cosim.report import film
from merge_cosim.report.film import HELD, Film
from merge_cosim.sweeps.other_cars import other_cars

CASE = "d+1_h11_m11"


@pytest.fixture(scope="module")
def run():
    return mc.run("designed-2", CASE, "pgm", world="closed-form")


def test_both_fronts_are_at_their_stations(run):
    drawn = Film(run.stage, run.trace, "", "")
    host, merging = (centres for centres, _ in drawn._cars)
    np.testing.assert_allclose(host[:, 0] + 2.5, run.trace["host_station_m"], atol=1e-3)
    np.testing.assert_allclose(host[:, 1], 0.0, atol=0.05)  # lanes that meet in a junction are joined halfway
    way = np.hypot(*np.diff(merging[run.trace["merging_station_m"] < -10], axis=0).T).sum()
    stations = run.trace.loc[run.trace["merging_station_m"] < -10, "merging_station_m"]
    assert way == pytest.approx(stations.iloc[-1] - stations.iloc[0], abs=0.3)
    assert merging[0, 1] < -3.0  # the ramp comes from the right


@pytest.fixture(scope="module")
def in_scene():
    how = {"model": "us101-ngsim", "source": "surrogate"}  # the surrogate's own model has seen some of its few cars
    return mc.run("us101-scene", "surrogate_1-112.1-h106.1", "pgm", **how)


def test_the_car_ahead_is_drawn_at_its_gap(in_scene):
    drawn = in_scene._film("stills")
    cycle = 40
    now = in_scene.trace.iloc[cycle]
    backs = [corners[:, 0].min() for corners in drawn._others[cycle] if abs(corners[:, 1].mean()) < 1.0]
    ahead = min(back for back in backs if back > now["host_station_m"])
    assert ahead - now["host_station_m"] == pytest.approx(now["leader_gap_m"], abs=0.2)  # the road bends a little
    assert len(next(iter(drawn.stills(1))).axes[0].collections[0].get_paths()) == len(drawn._others[1])


@pytest.mark.slow
def test_a_meeting_in_traffic_has_other_cars_with_the_lengths_of_their_types(tmp_path):
    scene = mc.load_scenario("traffic-light", {"encounters.demand.duration": 120, "encounters.replications": 1})
    results = mc.sweep([scene], ["acc"], jobs=1)
    run = mc.run(scene, results.rows["case"].iloc[0], "acc")
    others = other_cars(run.task, run.row["case"])
    host, merging = run.row["case"].split("/")[1:]
    assert {host, merging}.isdisjoint(others["car"])
    assert set(others["length_m"]) <= {4.4, 4.7, 5.0, 5.2, 14.0}
    assert (others.groupby("car")["length_m"].nunique() == 1).all()
    assert other_cars(mc.run("designed-2", CASE, "acc").task, CASE) is None


def test_a_video_has_a_frame_per_cycle_and_holds_the_last(run, tmp_path):
    short = replace(run, trace=run.trace[-3:])
    with Image.open(short.video(tmp_path / "new" / "case.gif")) as gif:
        lasts = [frame.info["duration"] for frame in ImageSequence.Iterator(gif)]
    assert len(lasts) == 3  # Pillow joins frames that are the same
    assert lasts == [100, 100, 100 * (1 + HELD)]
    assert short.video(tmp_path / "case.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(("suffix", "head"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_stills_are_numbered(run, tmp_path, suffix, head):
    files = run.stills(2, tmp_path / f"still.{suffix}")
    assert [file.name for file in files] == [f"still-1.{suffix}", f"still-2.{suffix}"]
    assert all(file.read_bytes().startswith(head) for file in files)


def test_the_last_frame_says_how_it_ended_and_what_was_decided(run):
    first, last = (
        {text.get_text() for text in figure.texts}
        for figure in Film(run.stage, run.trace, "case", "FAILED: they overlap").stills(2)
    )
    assert "case: FAILED: they overlap" in last
    assert "case" in first
    assert ("follows it" if run.trace["not_yield"].iloc[-1] else "goes first") in last


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--video", "x.avi"), "--video x.avi: is written as .mp4 or .gif"),
        (("--stills", 2, "--stills-file", "x.jpg"), "--stills-file x.jpg: is written as .png, .svg or .pdf"),
    ],
)
def test_another_kind_of_file_is_one_line_and_status_2(command, capsys, words, message):
    assert command("run", "designed-2", "--case", CASE, "--method", "pgm", *words) == 2
    assert capsys.readouterr().err == f"merge-cosim: {message}\n"


def test_no_encoder_is_one_line(run, monkeypatch):
    monkeypatch.setattr(film, "find_spec", lambda name: None)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(mc.UserError, match=r"needs ffmpeg: pip install 'merge-cosim\[video\]', or give a \.gif"):
        run.video("x.mp4")

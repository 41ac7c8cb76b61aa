"""The bench: the alternatives decide as ours does, and all figures stand on the page."""

import json
from functools import partial
from pathlib import Path

import pytest
from command import merge_cosim, small_scenario

from merge_cosim.bench import loops, peers, scaling, scenes, updates, worlds
from merge_cosim.bench.bench import PARTS, crowded, machine
from merge_cosim.bench.regression import against, read_figures
from merge_cosim.core.errors import UserError
from merge_cosim.estimators.base import estimators
from merge_cosim.sweeps.worker_session import WorkerSession

CHECKOUT = Path(__file__).parents[2]


@pytest.mark.slow
def test_every_figure_is_there_and_on_the_page(tmp_path, monkeypatch):
    monkeypatch.setattr(worlds, "METHODS", ("acc", "pgm"))
    monkeypatch.setattr(worlds, "SCENARIO", str(small_scenario(tmp_path)))
    monkeypatch.setattr(scenes, "MODELS", ("Krauss",))
    monkeypatch.setattr(scaling, "COUNTS", (1, 2))
    monkeypatch.setattr(updates, "CYCLES", 5)
    monkeypatch.setattr(peers, "environment_steps", partial(peers.environment_steps, 64, 10, 20))
    sizes = ("--cases", 200, "--sample", 10, "--rounds", 1, "--largest", 1, "--jobs", 2, "--copies", 1)
    done = merge_cosim("bench", *sizes, "--other", CHECKOUT, "--page", "bench.md", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr  # it fails if an alternative's outcomes are not ours
    found = json.loads(done.stdout)
    for name in ("ratio_to_bare_sumo", "speedup_vs_scalar", "speedup_vs_restart", "speedup_vs_traci"):
        assert found[name] > 0  # how large they are is for the bench to say, not for a test
    assert found["vehicle_steps_per_s"] > 0
    assert 1.0 < found["steps_and_calls_to_bare_sumo"] < found["ratio_to_bare_sumo"]
    assert {row["estimator"] for row in found["estimators"]} == set(estimators.names())
    assert all(row["full_batch_us"] > 0 for row in found["estimators"])
    assert [(row["cases"], row["processes"]) for row in found["scaling"]] == [(1, 1), (1, 2)]
    assert [row["model"] for row in found["scenes"]] == ["Krauss"]
    assert all(row["real_time_factor"] > 0 and row["meetings"] > 0 for row in found["scenes"])
    assert all(row["peak_mib"] > 50 and row["cpu_s"] > 0 for row in found["scaling"])
    assert [row["method"] for row in found["worlds"]] == ["acc", "pgm"]
    assert all(0 < row["closed_form_cpu_us"] < row["sumo_cpu_us"] for row in found["worlds"])
    assert [row["methods"].count(",") + 1 for row in found["methods"]] == [1, 2]
    assert found["peers"][0]["simulator"] == "merge-cosim Merge-v0"
    assert 0.2 < found["other"]["cpu_ratio"] < 5.0  # the other version is this one
    assert set(found["load"]) == {*PARTS, "other"}
    assert found["machine"]["processor"] == machine()["processor"]
    page = (tmp_path / "bench.md").read_text()
    alone, both = found["scaling"][-2:]
    gain = (
        f"Over 1 cases 2 processes are {alone['run_s'] / both['run_s']:.2f} times as fast as 1 by the time of the run"
    )
    for shown in (found["machine"]["processor"], str(found["speedup_vs_traci"]), "| pgm |", "--sample 10", gain):
        assert shown in page
    assert read_figures(tmp_path / "bench.json") == found


def test_a_ratio_that_fell_is_worse():
    one = {"peers": [{"simulator": "merge-cosim", "ours_makes_more_by": 1.0}], "ratio_to_bare_sumo": 1.6}
    before = one | {"peers": [*one["peers"], {"simulator": "slow", "ours_makes_more_by": 100.0}]}
    now = one | {"peers": [*one["peers"], {"simulator": "slow", "ours_makes_more_by": 84.0}]}
    kept, fell = against(now, before, 0.15)
    assert (kept["ratio"], kept["before"], kept["worse"]) == ("loop: share of time inside SUMO's steps", 0.625, False)
    assert (fell["ratio"], fell["change_pct"], fell["worse"]) == ("environment: more steps than slow", -16.0, True)
    assert not against(now, before, 0.17)[1]["worse"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--only", "walls"), "no part 'walls'; the parts are loops, worlds"),
        (("--only", "methods", "--other", "."), "no checkout of merge-cosim"),
        (("--only", "peers", "--commonroad-python", "nowhere"), "nowhere: no such file"),
        (("--against", "bench.json"), "bench.json: no figures of a bench"),
    ],
)
def test_a_wrong_option_of_the_bench_is_one_line(tmp_path, options, message):
    done = merge_cosim("bench", *options, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr


@pytest.mark.slow
def test_outcomes_are_compared_case_by_case(monkeypatch):
    real = loops._run_script

    def one_wrong(script, task):
        timing = real(script, task)
        return loops.Timing(timing.us_per_vehicle_step, timing.cpu_us, (not timing.failed[0], *timing.failed[1:]))

    monkeypatch.setattr(loops, "_run_script", one_wrong)
    with pytest.raises(UserError, match=r"scalar\.py finds other failures than ours"):
        loops.compare(200, 20, 1)


def test_a_part_under_too_much_load_is_marked():
    found = {"machine": {"cores": 2}, "load": {"loops": 2.5, "worlds": 2.6, "scenes": None}}
    assert (crowded(found, "loops"), crowded(found, "scenes")) == ("", "")
    assert "load rose to 2.6 on 2 cores" in crowded(found, "worlds")


def test_a_sweep_that_fails_ends_the_bench():
    with pytest.raises(UserError, match=r"bench: merge-cosim sweep .* failed: merge-cosim: "):
        scaling.scaling([0], [1], 1)


def test_the_sample_holds_failures(tmp_path):
    task = loops._task(400)
    worker_session = WorkerSession()
    try:
        rows, _ = task.run(worker_session)
    finally:
        worker_session.close()
    assert 0 < sum(rows["failed"].to_pylist()) < len(rows)

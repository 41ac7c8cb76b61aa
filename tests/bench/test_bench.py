"""The bench: the alternatives decide as ours does, and all figures stand on the page."""

import json

import pytest
from command import merge_cosim

from merge_cosim.bench import loops
from merge_cosim.bench.bench import crowded, machine
from merge_cosim.bench.scaling import scaling
from merge_cosim.bench.scenes import MODELS
from merge_cosim.bench.updates import estimator_costs
from merge_cosim.bench.worlds import METHODS
from merge_cosim.core.errors import UserError
from merge_cosim.estimators.base import estimators
from merge_cosim.sweeps.worker_session import WorkerSession


@pytest.mark.slow
def test_every_figure_is_there_and_on_the_page(tmp_path):
    arguments = (
        "--cases",
        400,
        "--sample",
        30,
        "--rounds",
        1,
        "--largest",
        9,
        "--jobs",
        2,
        "--copies",
        1,
        "--page",
        "bench.md",
    )
    done = merge_cosim("bench", *arguments, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr  # it fails if an alternative's outcomes are not ours
    found = json.loads(done.stdout)
    for name in ("ratio_to_bare_sumo", "speedup_vs_scalar", "speedup_vs_restart", "speedup_vs_traci"):
        assert found[name] > 0  # how large they are is for the bench to say, not for a test
    assert found["vehicle_steps_per_s"] > 0
    assert {row["estimator"] for row in found["estimators"]} == set(estimators.names())
    assert [(row["cases"], row["processes"]) for row in found["scaling"]] == [
        (cases, jobs) for cases in (1, 9) for jobs in (1, 2)
    ]
    assert [row["model"] for row in found["scenes"]] == list(MODELS)
    assert all(row["real_time_factor"] > 0 and row["meetings"] > 0 for row in found["scenes"])
    assert all(row["peak_mib"] > 50 and row["cpu_s"] > 0 for row in found["scaling"])
    assert [row["method"] for row in found["worlds"]] == list(METHODS)
    assert all(0 < row["closed_form_cpu_us"] < row["sumo_cpu_us"] for row in found["worlds"])
    assert set(found["load"]) >= {"loops", "worlds", "estimators", "scenes", "scaling"}
    assert found["machine"]["processor"] == machine()["processor"]
    page = (tmp_path / "bench.md").read_text()
    alone, both = found["scaling"][-2:]
    gain = f"Over 9 cases 2 processes are {alone['run_s'] / both['run_s']:.2f} times as fast as 1 by `run_s`"
    for shown in (found["machine"]["processor"], str(found["speedup_vs_traci"]), "| pgm |", "--sample 30", gain):
        assert shown in page


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
    found = {"machine": {"cores": 2}, "load": {"loops": 2.0, "worlds": 2.1, "scenes": None}}
    assert (crowded(found, "loops"), crowded(found, "scenes")) == ("", "")
    assert "load rose to 2.1 on 2 cores" in crowded(found, "worlds")


def test_a_sweep_that_fails_ends_the_bench():
    with pytest.raises(UserError, match="bench: a sweep of 0 cases failed: merge-cosim: "):
        scaling([0], [1], 1)


def test_the_sample_holds_failures(tmp_path):
    task = loops._task(400)
    worker_session = WorkerSession()
    try:
        rows, _ = task.run(worker_session)
    finally:
        worker_session.close()
    assert 0 < sum(rows["failed"].to_pylist()) < len(rows)


def test_costs_of_all_estimators_are_measured():
    costs = estimator_costs(rounds=1)
    assert {row["estimator"] for row in costs} == set(estimators.names())
    assert all(row["full_batch_us"] > 0 for row in costs)
